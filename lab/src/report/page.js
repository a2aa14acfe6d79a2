// Tables sort by the column whose heading is pressed; "All figures" shows the rows that hold the words typed.
"use strict";

for (const table of document.querySelectorAll("table.sortable")) {
  const headings = [...table.tHead.rows[0].cells];
  const body = table.tBodies[0];
  headings.forEach((heading, column) => {
    heading.firstElementChild.addEventListener("click", () => {
      // Numbers begin with the greatest, names with the first.
      const isNumber = heading.classList.contains("number");
      const now = heading.getAttribute("aria-sort");
      const ascending = now === "none" ? !isNumber : now === "descending";
      headings.forEach((other) => other.setAttribute("aria-sort", "none"));
      heading.setAttribute("aria-sort", ascending ? "ascending" : "descending");
      const value = (row) => row.cells[column].dataset.value;
      const compare = (a, b) => {
        const [x, y] = [value(a), value(b)];
        // What was not measured stays below, whichever way.
        if (x === "" || y === "") return (x === "") - (y === "");
        const order = isNumber ? Number(x) - Number(y) : x.localeCompare(y);
        return ascending ? order : -order;
      };
      body.append(...[...body.rows].sort(compare));
    });
  });
}

const filter = document.getElementById("filter");
filter?.addEventListener("input", () => {
  const words = filter.value.toLowerCase().split(/\s+/).filter(Boolean);
  for (const row of document.getElementById("results-table").tBodies[0].rows) {
    const text = [...row.cells].slice(0, 2).map((cell) => cell.textContent + " " + cell.dataset.value).join(" ").toLowerCase();
    row.hidden = !words.every((word) => text.includes(word));
  }
});
