// Each tree shows the level that its slider, its buttons or a row of its table say.
"use strict";

for (const tree of document.querySelectorAll(".navigator")) {
  const slider = tree.querySelector("input");
  if (!slider) continue;
  const show = () => {
    for (const part of tree.querySelectorAll("[data-level]")) part.classList.toggle("now", part.dataset.level === slider.value);
    tree.querySelector("output").textContent = tree.querySelector("g.now").dataset.says;
  };
  slider.addEventListener("input", show);
  const go = (level) => { slider.value = level; show(); };
  for (const button of tree.querySelectorAll("[data-by]")) {
    button.addEventListener("click", () => go(Number(slider.value) + Number(button.dataset.by)));
  }
  for (const row of tree.querySelectorAll("tr[data-level]")) row.addEventListener("click", () => go(row.dataset.level));
  // What a reload has kept in the slider.
  show();
}
