"use strict";
// A report, the page of a course or of a simulation: its charts, copying Table 1, links into folded parts, print.

const DRAWN = new Map();

// A chart needs the width of its container, so charts in a folded part are made when it is first opened.
function whenSeen(figure, make) {
  const folds = [];
  for (let fold = figure.closest("details"); fold; fold = fold.parentElement.closest("details")) folds.push(fold);
  const attempt = () => { if (!DRAWN.has(figure) && folds.every((fold) => fold.open)) make(); };
  for (const fold of folds) fold.addEventListener("toggle", attempt);
  attempt();
}

// For print every chart is drawn on a canvas of four times the pixels; of many charts, with fewer.
async function toPaper(figures, charts) {
  const times = Math.max(1, Math.min(4, Math.floor(64 / figures.length)));
  for (const figure of figures) {
    const canvas = await paper(charts[figure.dataset.chart], figure.closest(".pair") ? 330 : 660, times, DRAWN.get(figure) || null);
    canvas.className = "paper";
    figure.prepend(canvas);
  }
}

function begin() {
  const charts = JSON.parse(document.getElementById("charts").textContent).map(decoded), figures = [...document.querySelectorAll("figure[data-chart]")];
  document.documentElement.classList.add("live");
  for (const figure of figures) {
    whenSeen(figure, () => {
      const box = element("div", "", { className: "chart", id: `${figure.id}-chart` });
      figure.prepend(box);
      DRAWN.set(figure, new Chart(box, charts[figure.dataset.chart]));
    });
  }
  for (const place of document.querySelectorAll(".copy")) {
    const table = place.closest("section").querySelectorAll("table");
    const cells = () => [...table].flatMap((each) => [...each.rows].map((row) => [...row.cells].map((cell) => cell.dataset.cells?.replaceAll("|", "\t") ?? cell.textContent.trim()).join("\t"))).join("\n");
    place.append(makeButton("Copy as cells", async (button) => {
      button.textContent = (await copyText(cells())) ? "Copied" : "Not allowed by the browser";
      setTimeout(() => { button.textContent = "Copy as cells"; }, 1500);
    }));
  }
  // A link into a folded part opens it; for printing, everything is opened and closed again afterwards.
  const reveal = () => {
    const target = location.hash && document.getElementById(decodeURIComponent(location.hash.slice(1)));
    for (let fold = target && target.closest("details"); fold; fold = fold.parentElement.closest("details")) fold.open = true;
    if (target) target.scrollIntoView();
  };
  addEventListener("hashchange", reveal);
  for (const link of document.querySelectorAll('a[href^="#"]')) link.addEventListener("click", () => setTimeout(reveal));
  reveal();
  let opened = [];
  addEventListener("beforeprint", () => {
    opened = [...document.querySelectorAll("details:not([open])")];
    for (const fold of opened) fold.open = true;
    toPaper(figures, charts);
  });
  addEventListener("afterprint", () => {
    for (const fold of opened) fold.open = false;
    for (const canvas of document.querySelectorAll(".paper")) canvas.remove();
  });
}

begin();
