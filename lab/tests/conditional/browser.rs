//! A real browser, headless: opens a page from the disk as a reader does, and tells what a script finds there.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

/// The browser: `HEDGEROW_CHROMIUM`, or one that lies in the path.
pub struct Browser(PathBuf);

/// Before and behind what a test looks for: what holds for every page.
const BEFORE: &str = r#"<script>addEventListener("load", () => {
  const all = (selector) => [...document.querySelectorAll(selector)];
  // Labels of a chart that cover each other, and labels that stick out of it.
  const covering = [], outside = [];
  for (const svg of all(".chart svg")) {
    const frame = svg.getBoundingClientRect();
    const texts = [...svg.querySelectorAll("text")].map((text) => [text.textContent.trim(), text.getBoundingClientRect()]);
    texts.forEach(([name, a], i) => {
      if (a.left < frame.left - 1 || a.right > frame.right + 1 || a.top < frame.top - 1 || a.bottom > frame.bottom + 1)
        outside.push(`${svg.querySelector("title").textContent}: ${name}`);
      for (const [other, b] of texts.slice(i + 1)) {
        const w = Math.min(a.right, b.right) - Math.max(a.left, b.left);
        const h = Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top);
        if (w > 2 && h > 5) covering.push(`${svg.querySelector("title").textContent}: ${name} / ${other}`);
      }
    });
  }
  const urls = all("[src], link[href], a[href]").map((e) => e.getAttribute("src") ?? e.getAttribute("href"));
  const found = {
    sections: all("main section").map((section) => section.id),
    dangling: all("a[href^='#']").filter((a) => !document.querySelector(a.getAttribute("href"))).length,
    charts: all(".chart svg").length,
    unread: all(".chart svg").filter((svg) => !svg.querySelector("title") || !svg.querySelector("desc").textContent).length,
    external: urls.filter((url) => /^(https?:)?\/\//.test(url)).length,
    sideways: document.documentElement.scrollWidth > innerWidth,
    covering, outside,
  };
  Object.assign(found, (() => {
"#;
const BEHIND: &str = r#"
  })());
  const out = document.createElement("pre");
  out.id = "probe";
  out.textContent = JSON.stringify(found);
  document.body.append(out);
});</script></body>"#;

impl Browser {
    /// The one that is there: tests that take it need `needs::browser()`.
    pub fn find() -> Browser {
        Browser(crate::conditional::browser().expect("a test that needs a browser says so"))
    }

    /// Opens a page, and gives what is found there: sections, charts and links, and what `look`, the body of a function of
    /// JavaScript, returns beside. Nothing may be said on the console, no link dangle, nothing come from elsewhere, no label of
    /// a chart cover another or stick out, and the page not be wider than its window.
    pub fn look(&self, page: &Path, look: &str) -> serde_json::Value {
        let html = std::fs::read_to_string(page).expect("the page is there");
        let probed = page.with_extension("probed.html");
        // Pictures below the window are loaded too, so that all are there when the script looks.
        let html = html.replace("loading=\"lazy\"", "").replace("</body>", &[BEFORE, look, BEHIND].concat());
        std::fs::write(&probed, html).expect("a folder of our own");
        let (document, log) = self.open(&probed);
        let console: Vec<_> = log.lines().filter(|line| line.contains("CONSOLE")).collect();
        assert!(console.is_empty(), "the console says {console:?}");
        let found = document.split_once("<pre id=\"probe\">").and_then(|(_, rest)| rest.split_once("</pre>"));
        let found = found.unwrap_or_else(|| panic!("the script did not run: {log}")).0.replace("&amp;", "&");
        let found: serde_json::Value = serde_json::from_str(&found).expect("the script writes JSON");
        assert_eq!(found["dangling"], 0, "{found}");
        assert_eq!(found["unread"], 0, "{found}");
        assert_eq!(found["external"], 0, "{found}");
        assert_eq!(found["sideways"], false, "the page is wider than its window");
        assert_eq!(found["covering"], serde_json::json!([]), "labels cover each other");
        assert_eq!(found["outside"], serde_json::json!([]), "labels stick out of their chart");
        found
    }

    /// Opens a page and gives its document after its scripts have run, and what the browser logged.
    fn open(&self, page: &Path) -> (String, String) {
        let profile = tempfile::tempdir().expect("a temporary folder");
        let (document, log) = (profile.path().join("document.html"), profile.path().join("log.txt"));
        let file = |path| std::fs::File::create(path).expect("a folder of our own");
        let mut child = Command::new(&self.0)
            .args(["--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-sync"])
            .args([
                "--disable-background-networking",
                "--disable-component-update",
                "--enable-logging=stderr",
                "--dump-dom",
            ])
            .arg("--window-size=1400,1000")
            .arg(format!("--user-data-dir={}", profile.path().display()))
            .arg(format!("file://{}", page.display()))
            .stdout(file(&document))
            .stderr(file(&log))
            .spawn()
            .expect("the browser starts");
        let start = Instant::now();
        while child.try_wait().expect("the browser is ours").is_none() {
            if start.elapsed() > Duration::from_secs(60) {
                child.kill().expect("the browser is ours");
                panic!("the browser did not finish within 60 s");
            }
            std::thread::sleep(Duration::from_millis(50));
        }
        let read = |path| std::fs::read(path).map(|b| String::from_utf8_lossy(&b).into_owned()).expect("just written");
        (read(&document), read(&log))
    }
}
