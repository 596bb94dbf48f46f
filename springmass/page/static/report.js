"use strict";
// The charts of a report. Their numbers are in the page; without this script, and in print, the figures are shown
// instead.

const REPORT = JSON.parse(document.getElementById("report-data").textContent);

function timesOf(t) { return Array.isArray(t) ? t : Array.from({ length: t.count }, (_, i) => t.start + t.step * i); }

// Put a chart before the card of its figure; from then on, the card is shown only in print.
function placeIn(figure, heights) {
  const holder = document.createElement("div");
  holder.className = "charts";
  const bar = document.createElement("div");
  bar.className = "bar";
  bar.setAttribute("role", "toolbar");
  bar.ariaLabel = "zoom and move";
  const value = document.createElement("output");
  value.className = "value";
  value.textContent = "Drag to zoom, Shift and drag to move, double-click to show all.";
  bar.append(value);
  holder.append(bar);
  const boxes = heights.map((height, i) => {
    const box = document.createElement("div");
    box.id = `${figure.id}-chart-${i}`;
    box.className = "chart";
    box.style.height = `${height}px`;
    holder.append(box);
    return box;
  });
  figure.prepend(holder);
  figure.classList.add("live");
  return { bar, value, boxes };
}

const several = (u) => (u === "" ? "" : ` / ${u}`);
const number = (v, digits) => (v === null || v === undefined ? "–" : Number(v).toPrecision(digits || 6).replace("-", "−"));

function positionChart(figure, run) {
  const t = timesOf(run.t), data = run.data, flagged = new Map(data.flagged), fit = data.fit;
  const used = data.y.map((y, i) => (flagged.has(i) ? null : y));
  const out = data.y.map((y, i) => (flagged.has(i) ? y : null));
  const residual = fit && data.y.map((y, i) => (flagged.has(i) || fit[i] === null || y === null ? null : y - fit[i]));
  const { bar, value, boxes } = placeIn(figure, fit ? [300, 140] : [300]);
  let explorer = null;
  const options = (key) => {
    const common = Explorer.options(() => explorer, key);
    common.legend = LEGEND;
    common.hooks.setCursor = [(plot) => {
      const i = plot.cursor.idx;
      if (i === null || i === undefined) return;
      const why = flagged.has(i) ? `; left out: ${flagged.get(i)}` : fit && fit[i] !== null && data.y[i] !== null ? `; residual ${number(data.y[i] - fit[i], 3)} ${data.unit}` : "";
      value.textContent = `t = ${number(t[i])} s: ${number(data.y[i], 5)} ${data.unit}${why}`;
    }];
    return common;
  };
  const label = `${data.quantity}${several(data.unit)}`;
  const dots = { ...points("samples used"), points: { show: true, size: 3 }, stroke: colour("other-4"), fill: colour("other-4") };
  const crosses = { ...points("left out"), key: "ring", points: { show: true, size: 6, fill: "transparent" }, stroke: colour("fit") };
  const law = line("fit", "ink", undefined, 1.2);
  const key = figure.id;
  const y = used.filter((v) => v !== null).concat(fit ? fit.filter((v) => v !== null) : []);
  const low = y.reduce((a, b) => Math.min(a, b), Infinity), high = y.reduce((a, b) => Math.max(a, b), -Infinity), margin = 0.06 * (high - low) || 1;
  const scales = { x: { time: false }, y: { range: [low - margin, high + margin] } };
  const charts = [new Chart(boxes[0].id, fit ? [law, dots, crosses] : [dots, crosses], ["time / s", label], { ...options(key), scales })];
  charts[0].show(fit ? [t, fit, used, out] : [t, used, out]);
  if (fit) {
    const zero = { scales: { x: { time: false } } };
    charts.push(new Chart(boxes[1].id, [{ ...points("residual"), points: { show: true, size: 3 } }], ["time / s", `residual${several(data.unit)}`], { ...options(key), ...zero }));
    charts[1].show([t, residual]);
  }
  explorer = new Explorer(bar, charts, [t[0], t[t.length - 1]]);
}

function amplitudeChart(figure, run) {
  const { amplitude: a, unit } = run.data;
  if (!a) return;
  const { bar, value, boxes } = placeIn(figure, figure.closest(".first") ? [270, 110] : [340, 140]);
  const out = new Set(a.left_out);
  const named = a.laws.filter((law, i) => i === 0 || law.name === "linear" || law.status === "admissible").slice(0, 4);
  const others = a.laws.filter((law) => !named.includes(law));
  const colours = ["ink", ...OTHERS];
  const series = [
    ...others.map((law, i) => ({ ...line(others.length > 1 ? `${others.length} other laws` : `${law.name} (${law.status})`, "rest", [1, 3], 1) })),
    ...named.map((law, i) => line(`${law.name === "linear" ? "exponential, linear drag" : law.name} (${law.status})`, colours[i], i ? DASHES[i - 1] : undefined, i ? 1.6 : 1.8)),
    { ...points("amplitude of one window"), points: { show: true, size: 4 } },
    { ...points("left out of the fits"), key: "ring", points: { show: true, size: 7, fill: "transparent" }, stroke: colour("other-3"), show: out.size > 0 },
  ];
  const kept = a.y.map((y, i) => (out.has(i) ? null : y)), left = a.y.map((y, i) => (out.has(i) ? y : null));
  let explorer = null;
  const more = () => {
    const common = Explorer.options(() => explorer, figure.id);
    common.legend = LEGEND;
    common.hooks.setCursor = [(plot) => {
      const i = plot.cursor.idx;
      if (i !== null && i !== undefined) value.textContent = `t = ${number(a.t[i], 5)} s: amplitude ${number(a.y[i], 5)} ± ${number(a.u[i], 2)} ${unit}${out.has(i) ? "; left out of the fits" : ""}`;
    }];
    return common;
  };
  // The legend has one entry for all other laws, and none for points that do not exist.
  const brief = (plot) => plot.root.querySelectorAll(".u-legend .u-series").forEach((row, i) => { row.hidden = (i > 0 && i < others.length) || (i === series.length - 1 && out.size === 0); });
  const low = Math.min(...a.y), high = Math.max(...a.y), margin = 0.1 * (high - low) || 1;
  const above = more(), below = more();
  above.hooks.draw = [errorBars(series.length - 1, a.u)];
  above.hooks.ready = [brief];
  below.legend = { show: false };
  const chart = new Chart(boxes[0].id, series, ["time / s", `amplitude${several(unit)}`], { ...above, scales: { x: { time: false }, y: { range: [low - margin, high + margin] } } });
  chart.show([a.t, ...others.map((law) => law.y), ...named.map((law) => law.y), kept, left]);
  const residual = new Chart(boxes[1].id, [{ ...points("residual / u"), points: { show: true, size: 4 } }], ["time / s", "residual / u"], { ...below, scales: { x: { time: false } } });
  residual.show([a.t, a.y.map((y, i) => (out.has(i) || !a.u[i] ? null : (y - a.laws[0].y[i]) / a.u[i]))]);
  explorer = new Explorer(bar, [chart, residual], [a.t[0], a.t[a.t.length - 1]]);
}

function frequencyChart(figure, run) {
  const { frequency: f, unit } = run.data;
  if (!f) return;
  const { bar, value, boxes } = placeIn(figure, [300]);
  let explorer = null;
  const more = Explorer.options(() => explorer, figure.id);
  more.legend = LEGEND;
  const shift = (hz) => (hz === null ? null : 1e3 * (hz - f.mean));
  more.hooks.draw = [errorBars(2, f.u.map((u) => (u === null ? null : 1e3 * u)))];
  more.hooks.setCursor = [(plot) => {
    const i = plot.cursor.idx;
    if (i !== null && i !== undefined) value.textContent = `amplitude ${number(f.a[i], 4)} ${unit}: ${number(f.f[i], 7)} ± ${number(f.u[i], 2)} Hz`;
  }];
  const chart = new Chart(boxes[0].id, [line("model", "ink", undefined, 1.6), { ...points("a stretch of the run"), points: { show: true, size: 6 } }], [`amplitude${several(unit)}`, `(frequency − ${number(f.mean, 5)} Hz) / mHz`], { ...more, scales: { x: { time: false } } });
  chart.show([f.a, f.model.map(shift), f.f.map(shift)]);
  explorer = new Explorer(bar, [chart], [f.a[0], f.a[f.a.length - 1]]);
}

function overlayChart(figure, runs) {
  const colours = ["data", "fit", ...OTHERS];
  const { bar, value, boxes } = placeIn(figure, [260]);
  const tables = runs.map((run) => {
    const flagged = new Set(run.data.flagged.map(([i]) => i)), t = timesOf(run.t), used = run.data.y.map((y, i) => (flagged.has(i) ? null : y));
    const known = used.filter((y) => y !== null), rest = known.reduce((sum, y) => sum + y, 0) / Math.max(known.length, 1), first = t[used.findIndex((y) => y !== null)] || 0;
    return [t.map((x) => x - first), used.map((y) => (y === null ? null : y - rest))];
  });
  let explorer = null;
  const more = Explorer.options(() => explorer, figure.id);
  more.legend = LEGEND;
  more.hooks.setCursor = [(plot) => {
    const i = plot.cursor.idx;
    if (i !== null && i !== undefined) value.textContent = `t = ${number(plot.data[0][i], 5)} s`;
  }];
  const series = runs.map((run, i) => ({ ...line(run.name, colours[i % colours.length], i ? DASHES[(i - 1) % DASHES.length] : undefined, 1), spanGaps: true }));
  const chart = new Chart(boxes[0].id, series, ["time since the first sample / s", `displacement${several(runs[0].data.unit)}`], { ...more, scales: { x: { time: false } } });
  const data = uPlot.join(tables);
  chart.show(data);
  explorer = new Explorer(bar, [chart], [data[0][0], data[0][data[0].length - 1]]);
}

// A chart needs the width of its container, so charts in a folded part are made when it is first opened.
function whenSeen(figure, make) {
  const folds = [];
  for (let fold = figure.closest("details"); fold; fold = fold.parentElement.closest("details")) folds.push(fold);
  let made = false;
  const attempt = () => { if (!made && folds.every((fold) => fold.open)) { made = true; make(); } };
  for (const fold of folds) fold.addEventListener("toggle", attempt);
  attempt();
}

function button(words, act) {
  const made = document.createElement("button");
  made.type = "button";
  made.textContent = words;
  made.addEventListener("click", () => act(made));
  return made;
}

function confirmed(made, done) {
  const words = made.textContent;
  made.textContent = done ? "Copied" : "Not allowed by the browser";
  setTimeout(() => { made.textContent = words; }, 1500);
}

function saveFigure(figure) {
  const link = document.createElement("a");
  link.href = figure.querySelector(".card img").src;
  link.download = `${figure.dataset.file || figure.id}.svg`;
  link.click();
}

function begin() {
  const makers = { position: positionChart, amplitude: amplitudeChart, frequency: frequencyChart };
  for (const figure of document.querySelectorAll("figure[data-chart]")) {
    const run = REPORT.runs[Number(figure.dataset.run)], make = makers[figure.dataset.chart];
    if (make && run && run.data) whenSeen(figure, () => make(figure, run));
    if (figure.dataset.chart === "overlay") whenSeen(figure, () => overlayChart(figure, REPORT.runs));
  }
  for (const figure of document.querySelectorAll("figure")) {
    const actions = figure.querySelector(".actions");
    if (actions) actions.append(button("Save figure", () => saveFigure(figure)));
  }
  const copies = document.getElementById("copies");
  if (copies) {
    for (const [name, words] of [["text", "Copy as text"], ["latex", "Copy as LaTeX"], ["cells", "Copy as cells"]]) {
      copies.append(button(words, async (made) => confirmed(made, await copyText(REPORT.table[name]))));
    }
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
  addEventListener("beforeprint", () => { opened = [...document.querySelectorAll("details:not([open])")]; for (const fold of opened) fold.open = true; });
  addEventListener("afterprint", () => { for (const fold of opened) fold.open = false; });
}

begin();
