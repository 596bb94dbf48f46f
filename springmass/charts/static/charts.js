"use strict";
// Every chart of reports, courses, simulations and the page of a recording. A chart is an object as
// springmass/charts/chart.py makes it: panels of series, each with a role. uPlot draws the axes, this script the series.

// LOOKS is the table in springmass/charts/looks.py, which draws files too; the script that it makes stands before this one.
const RANK = { data: 0, law: 1, other: 2, time: 2, rest: 3, flagged: 4, band: 5, mark: 6 }, MANY = 2000, ZOOM = 0.5, PAN = 0.25, FONT = "system-ui, sans-serif";

// Light text means a dark background, whatever the page takes its colours from.
function isDark(box) {
  const [r, g, b] = getComputedStyle(box).color.match(/[\d.]+/g).map(Number);
  return 0.3 * r + 0.6 * g + 0.1 * b > 128;
}
function lookOf(role, i, dark) {
  const { dash, marker, opacity = [0.25], ...colours } = LOOKS[role], all = colours[dark ? "dark" : "light"];
  return { colour: all[i % all.length], dash: dash[i % dash.length], opacity: opacity[i % opacity.length], marker };
}
// The look of each series of a panel: series of one role with different labels take the looks of the role in turn.
function looksOf(panel, dark) {
  const numbers = new Map(), counts = {};
  return panel.series.map((s) => {
    const name = `${s.role} ${s.label}`;
    if (!numbers.has(name)) { counts[s.role] = (counts[s.role] || 0) + 1; numbers.set(name, counts[s.role] - 1); }
    return lookOf(s.role, numbers.get(name), dark);
  });
}

function decoded(chart) {
  const bytes = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer;
  const xs = chart.xs.map((x) => (x.after === undefined ? Float64Array.from({ length: x.count }, (_, i) => x.start + x.step * i) : Float64Array.from(new Float32Array(bytes(x.after)), (v) => x.start + v)));
  for (const panel of chart.panels) {
    for (const s of panel.series) {
      s.x = xs[s.x];
      for (const name of ["y", "u"]) if (s[name]) s[name] = new Float32Array(bytes(s[name]));
      if (s.why) s.why = s.why.map((i) => s.words[i]);
    }
  }
  return chart;
}

const known = (v) => v !== null && v !== undefined && !Number.isNaN(v);
// The range of values, a little wider than they are.
function around(values, log = false) {
  const found = values.filter((v) => known(v) && (!log || v > 0)), low = Math.min(...found), high = Math.max(...found);
  if (!found.length) return null;
  return log ? [0.8 * low, 2 * high] : [low - (0.07 * (high - low) || 1), high + (0.07 * (high - low) || 1)];
}
const minus = (text) => text.replaceAll("-", "−");
function written(v, digits = 5) {
  if (!known(v)) return "–";
  const size = Math.abs(v);
  return minus(size !== 0 && (size < 1e-4 || size >= 1e6) ? Number(v.toPrecision(3)).toExponential().replace("e+", "e") : String(Number(v.toPrecision(digits))));
}
// Numbers on an axis; a logarithmic one has them at powers of ten, or at more places if it spans less than two.
const ticks = (_, splits) => splits.map((v) => (v === null ? "" : written(v, 7)));
function powers(plot, splits, axis) {
  const { min, max } = plot.scales[axis === 0 ? "x" : "y"], places = max < 6 * min ? [1, 2, 3, 5, 7] : max < 30 * min ? [1, 2, 5] : [1];
  return splits.map((v) => (v !== null && places.some((m) => Math.abs(Math.log10(v / m) - Math.round(Math.log10(v / m))) < 1e-9) ? v : null));
}

// All 1 to 9 of each power of ten: uPlot's own begin at the end of the axis, which is no round number.
function decades(_, axis, min, max) {
  const found = [];
  for (let power = Math.floor(Math.log10(min)); 10 ** power <= max; power++) for (let m = 1; m < 10; m++) found.push(Number(`${m}e${power}`));
  return found.filter((v) => v >= min && v <= max);
}

// One pair of axes. ``more`` may have: scale (of all sizes, for paper), dark, size, hooks, cursor, hidden (labels that are
// switched off), joined (samples as a line), group (panels with one range), range of x.
class Panel {
  constructor(box, panel, more = {}) {
    this.box = box;
    this.more = { hidden: new Set(), group: { left: 0 }, scale: 1, ...more };
    this.take(panel);
    this.build();
    if (more.size) return;
    this.sizes = new ResizeObserver(() => { if (box.clientWidth) { this.plot.setSize(this.size()); if (this.panel.equal) this.show(this.panel); } });
    this.sizes.observe(box);
    this.media = matchMedia("(prefers-color-scheme: dark)");
    this.scheme = () => this.build();
    this.media.addEventListener("change", this.scheme);
  }

  // Stop a replaced panel from following changes of size and colour scheme.
  destroy() {
    if (this.sizes) { this.sizes.disconnect(); this.media.removeEventListener("change", this.scheme); }
    this.plot.destroy();
  }

  take(panel) {
    this.panel = panel;
    this.log = this.log === undefined || panel.log === null ? panel.log === true : this.log;
    const ends = [Infinity, -Infinity];
    for (const s of panel.series) for (let i = 0; i < s.x.length; i++) if (known(s.x[i]) && !(this.panel.log_x && s.x[i] <= 0)) { ends[0] = Math.min(ends[0], s.x[i]); ends[1] = Math.max(ends[1], s.x[i]); }
    if (panel.names && panel.names.length) ends.splice(0, 2, 0.5, panel.names.length + 0.5);
    if (panel.span) ends.splice(0, 2, ...panel.span);
    const margin = panel.log_x ? 0 : 0.012 * (ends[1] - ends[0]) || 0.5;
    this.span = ends[0] <= ends[1] ? [ends[0] - margin, ends[1] + margin] : [0, 1];
  }

  get dark() { return this.more.dark !== undefined ? this.more.dark : isDark(this.box); }
  size() { return this.more.size || { width: Math.max(this.box.clientWidth, 200), height: Math.max(this.box.clientHeight, 80) }; }
  visible() { return this.panel.series.filter((s) => !this.more.hidden.has(s.label)); }

  // A panel of residuals shows those of the chosen x in its whole height.
  reach() {
    const [low, high] = (this.panel.zero && this.more.range && this.residuals(...this.more.range)) || this.panel.range || [0.1, 1];
    return this.log && !(low > 0) ? [1e-3 * high, high] : [low, high];
  }

  residuals(from, to) {
    let most = 0;
    for (const s of this.visible()) {
      if (!["data", "band", "law"].includes(s.role)) continue;
      for (let i = 0; i < s.x.length; i++) if (s.x[i] >= from && s.x[i] <= to && known(s.y[i])) most = Math.max(most, Math.abs(s.y[i]) + (s.role === "band" && known(s.u[i]) ? s.u[i] : 0));
    }
    return most > 0 && [-1.1 * most, 1.1 * most];
  }

  // With equal axes, one unit of x is as long as that part of y which the motion reaches at the same time.
  ranges() {
    const y = this.reach(), x = this.span;
    if (!this.panel.equal) return { x, y };
    const { width, height } = this.plot ? this.plot.bbox : { width: 1, height: 1 }, wide = Math.max(1, width / height || 1), high = Math.max(1, height / width || 1);
    const grown = ([low, high_end], by) => [(low + high_end) / 2 - by * (high_end - low) / 2, (low + high_end) / 2 + by * (high_end - low) / 2];
    return { x: grown(x, 1.1 * wide), y: grown(y, high) };
  }

  data() { const { x, y } = this.ranges(); return [x, y]; }

  build() {
    const range = this.plot ? { ...this.plot.scales.x } : null;
    if (this.plot) this.plot.destroy();
    const { panel, more } = this, k = more.scale, dark = this.dark;
    const ink = lookOf("law", 0, dark).colour, grey = lookOf("rest", 0, dark).colour;
    const axis = (label, log) => ({
      label, stroke: ink, font: `${12 * k}px ${FONT}`, labelFont: `${12 * k}px ${FONT}`, labelSize: 18 * k, gap: 4 * k,
      grid: { stroke: grey + "40", width: k, ...(log && { filter: powers }) }, ticks: { stroke: grey, width: k, size: 5 * k, ...(log && { filter: powers }) },
      values: ticks, ...(log && { filter: powers, splits: decades }),
    });
    // All panels of a chart have the width of the widest numbers, so that their axes stand beneath one another.
    const left = (_, values) => (more.group.left = Math.max(more.group.left, k * (14 + 7 * Math.max(2, ...(values || []).map((v) => String(v).length)))));
    const x = { ...axis(panel.x_label, panel.log_x), size: 30 * k, space: 60 * k };
    if (more.bare) Object.assign(x, { label: null, labelSize: 0, size: 8 * k, values: (_, splits) => splits.map(() => "") });
    if (panel.names && panel.names.length) {
      const count = panel.names.length, room = this.size().width / k - 90, longest = Math.max(...panel.names.map((name) => name.length));
      const fit = Math.floor(room / count / 8), cut = fit < longest && fit >= 8, every = cut ? 1 : Math.ceil(((8 * longest + 10) * count) / room), shown = panel.names.map((_, i) => i + 1).filter((v) => (v - 1) % every === 0);
      Object.assign(x, { splits: () => shown, values: (_, at) => at.map((v) => (cut && panel.names[v - 1].length > fit ? `${panel.names[v - 1].slice(0, fit - 1)}…` : panel.names[v - 1])) });
    }
    const log = this.log && { distr: 3 };
    this.plot = new uPlot({
      ...this.size(), legend: { show: false }, series: [{}, { paths: () => null, points: { show: false } }],
      scales: {
        x: { time: false, range: () => more.range || this.ranges().x, ...(panel.log_x && { distr: 3 }) },
        y: { range: () => this.ranges().y, ...log },
      },
      axes: [x, { ...axis(panel.label, this.log), size: left, space: (...[, , , , long]) => Math.max(17 * k, long / 7) }],
      padding: [8 * k, 10 * k, 0, 0], cursor: more.cursor || { points: { show: false } },
      hooks: { ...more.hooks, draw: [(plot) => this.paint(plot), ...((more.hooks && more.hooks.draw) || [])] },
    }, this.data(), this.box);
    if (range && range.min != null && more.keep) this.plot.setScale("x", range);
  }

  show(panel) {
    this.take(panel);
    this.plot.setData(this.data());
  }

  paint(plot) {
    const { ctx, bbox } = plot, px = devicePixelRatio * this.more.scale, dark = this.dark;
    const at = (v) => plot.valToPos(v, "x", true), to = (v) => plot.valToPos(v, "y", true);
    const tools = { plot, ctx, bbox, px, at, to, log: this.log };
    ctx.save();
    ctx.beginPath();
    ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    ctx.clip();
    if (this.panel.zero) { ctx.fillStyle = lookOf("rest", 0, dark).colour; ctx.fillRect(bbox.left, to(0) - px / 2, bbox.width, px); }
    const looks = looksOf(this.panel, dark);
    for (const [i, s] of this.panel.series.entries()) {
      if (this.more.hidden.has(s.label)) continue;
      const look = looks[i];
      ctx.strokeStyle = ctx.fillStyle = look.colour;
      if (s.role === "mark") paintMarks(tools, s, look);
      else if (s.line || (this.more.joined && s.role === "data" && !s.u)) {
        if (s.u) paintBand(tools, s, look);
        if (s.role !== "band") paintLine(tools, s, look, this.panel.series.length > 1 || s.role !== "data");
      } else paintPoints(tools, s, look, this.log);
    }
    ctx.restore();
  }

  // The text of the point at a place on the screen; of those beyond the axis, which stand at its edge, too.
  pointAt(clientX, clientY) {
    const place = this.plot.over.getBoundingClientRect(), best = { far: 12, text: "" };
    for (const s of this.visible()) {
      for (let i = 0; s.why && s.y && i < s.x.length; i++) {
        const to = Math.min(Math.max(this.plot.valToPos(s.y[i], "y"), 0), place.height);
        const far = Math.hypot(this.plot.valToPos(s.x[i], "x") - clientX + place.left, to - clientY + place.top);
        if (far < best.far) Object.assign(best, { far, text: s.why[i] });
      }
    }
    return best.text;
  }

  // What stands under the cursor, in words; an empty text beside the axes.
  read() {
    const { left, top } = this.plot.cursor;
    if (left === null || left === undefined || left < 0) return "";
    const x = this.plot.posToVal(left, "x"), [name, unit] = this.panel.x_label.split(" / "), own = this.panel.label.split(" / ")[1] || "";
    const bare = (text) => (text || "").replace(/^\((.*)\)$/, "$1");
    if (this.panel.equal) return `${name} ${written(x)} ${bare(unit)}, ${this.panel.label.split(" / ")[0]} ${written(this.plot.posToVal(top, "y"))} ${bare(own)}`;
    const said = new Set(), texts = [], out = [];
    for (const s of [...this.visible()].sort((a, b) => RANK[a.role] - RANK[b.role])) {
      const i = nearest(s.x, x), far = i < 0 || Math.abs(this.plot.valToPos(s.x[i], "x") - left) > 12;
      if (s.role === "flagged" || s.role === "mark") { if (!far && s.why && s.why[i]) out.push(s.role === "mark" ? s.why[i] : `left out: ${s.why[i]}`); continue; }
      if (i < 0 || !known(s.y[i]) || said.has(s.label) || s.role === "band" || texts.length > 3 || (far && !s.line)) continue;
      said.add(s.label);
      texts.push(`${s.why ? s.why[i] : this.panel.names ? this.panel.names[Math.round(s.x[i]) - 1] : s.label} ${written(s.y[i])}${s.u && s.u[i] ? ` ± ${written(s.u[i], 2)}` : ""} ${bare(own)}`.trim());
    }
    const where = this.panel.names ? "" : `${name} ${written(x)} ${bare(unit)}: `;
    return where + [...texts, ...out].join("; ");
  }
}

function nearest(x, value) {
  let low = 0, high = x.length - 1;
  if (high < 0) return -1;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (x[middle] < value) low = middle + 1; else high = middle;
  }
  return low > 0 && value - x[low - 1] < x[low] - value ? low - 1 : low;
}

function paintBand({ ctx, at, to, log }, s, look) {
  ctx.save();
  ctx.globalAlpha = look.opacity;
  for (let i = 0; i < s.x.length;) {
    while (i < s.x.length && !known(s.y[i])) i += 1;
    const first = i;
    ctx.beginPath();
    for (; i < s.x.length && known(s.y[i]); i++) ctx.lineTo(at(s.x[i]), to(s.y[i] + s.u[i]));
    for (let j = i - 1; j >= first; j--) ctx.lineTo(at(s.x[j]), to(log ? Math.max(s.y[j] - s.u[j], 1e-6 * s.y[j]) : s.y[j] - s.u[j]));
    ctx.fill();
  }
  ctx.restore();
}

// A line that goes up and down all the time is solid, and lets what lies beneath it through.
const dashOf = (s, look, px) => (s.winds ? [] : look.dash.map((length) => length * px));
function paintLine({ ctx, at, to, px }, s, look, wide) {
  ctx.save();
  ctx.lineWidth = (wide && s.role !== "data" ? 1.4 : 1) * px;
  ctx.setLineDash(dashOf(s, look, px));
  if (s.winds) ctx.globalAlpha = 0.7;
  ctx.beginPath();
  let up = true;
  for (let i = 0; i < s.x.length; i++) {
    if (!known(s.y[i])) { up = true; continue; }
    if (up) ctx.moveTo(at(s.x[i]), to(s.y[i])); else ctx.lineTo(at(s.x[i]), to(s.y[i]));
    up = false;
  }
  ctx.stroke();
  ctx.restore();
}

function paintPoints({ plot, ctx, bbox, at, to, px }, s, look) {
  const { min, max } = plot.scales.x, many = s.x.length > MANY, r = (many ? 1.1 : s.role === "rest" || s.x.length > 80 ? 1.5 : 2.2) * px, edge = s.role === "flagged";
  ctx.lineWidth = px;
  if (s.u) {
    ctx.beginPath();
    for (let i = 0; i < s.x.length; i++) {
      if (!known(s.y[i]) || !known(s.u[i]) || s.x[i] < min || s.x[i] > max) continue;
      ctx.moveTo(at(s.x[i]), Math.max(-1e5, to(s.y[i] + s.u[i])));
      ctx.lineTo(at(s.x[i]), Math.min(1e5, to(s.y[i] - s.u[i]) || 1e5));
    }
    ctx.stroke();
  }
  for (let i = 0; i < s.x.length; i++) {
    if (!known(s.y[i]) || s.x[i] < min || s.x[i] > max) continue;
    const x = at(s.x[i]), y = edge ? Math.min(Math.max(to(s.y[i]), bbox.top + 2 * px), bbox.top + bbox.height - 2 * px) : to(s.y[i]);
    drawMarker(ctx, look.marker, x, y, r, many);
  }
}

function drawMarker(ctx, marker, x, y, r, many) {
  if (many && marker === "dot") { ctx.fillRect(x - r, y - r, 2 * r, 2 * r); return; }
  ctx.beginPath();
  if (marker === "cross") for (const s of [-1, 1]) { ctx.moveTo(x - 1.3 * r, y - 1.3 * s * r); ctx.lineTo(x + 1.3 * r, y + 1.3 * s * r); }
  else ctx.arc(x, y, marker === "ring" ? 1.2 * r : r, 0, 2 * Math.PI);
  if (marker === "dot") ctx.fill(); else ctx.stroke();
}

// Vertical lines, or rings at their values, with texts that do not cover one another.
function paintMarks({ plot, ctx, bbox, at, to, px }, s, look) {
  const taken = [], high = 13 * px;
  ctx.lineWidth = px;
  ctx.font = `${11 * px}px ${FONT}`;
  ctx.textAlign = "left";
  for (let i = 0; i < s.x.length; i++) {
    if (s.x[i] < plot.scales.x.min || s.x[i] > plot.scales.x.max) continue;
    const x = at(s.x[i]), ring = known(s.y[i]), text = (s.why ? s.why[i] : "").slice(0, 30), wide = ctx.measureText(text).width;
    if (ring) drawMarker(ctx, "ring", x, to(s.y[i]), 3 * px);
    else {
      ctx.setLineDash(look.dash.map((length) => length * px));
      ctx.beginPath();
      ctx.moveTo(x, bbox.top);
      ctx.lineTo(x, bbox.top + bbox.height);
      ctx.stroke();
      ctx.setLineDash([]);
    }
    const above = ring && to(s.y[i]) - 6 * px > bbox.top + high, beside = above ? -wide / 2 : (ring ? 7 : 4) * px;
    const left = Math.max(bbox.left, Math.min(x + beside, bbox.left + bbox.width - wide));
    const base = above ? to(s.y[i]) - 6 * px : Math.max(ring ? to(s.y[i]) + 4 * px : 0, bbox.top + high);
    if (taken.some((box) => left < box.left + box.wide && box.left < left + wide && Math.abs(base - box.base) < high)) continue;
    taken.push({ left, base, wide });
    ctx.fillText(text, left, base);
  }
}

// The range after a button is pressed, limited to that of the data.
function shifted([low, high], [first, last], action) {
  const wide = high - low, middle = (low + high) / 2;
  if (action === "all") return [first, last];
  if (action === "in") return [middle - wide * ZOOM / 2, middle + wide * ZOOM / 2];
  if (action === "out") return [Math.max(first, middle - wide / ZOOM / 2), Math.min(last, middle + wide / ZOOM / 2)];
  const by = Math.max(first - low, Math.min(last - high, (action === "left" ? -PAN : PAN) * wide));
  return [low + by, high + by];
}

// An element with text, or with parts, which are elements and texts, and with properties and data.
function element(name, content = "", more = {}) {
  const made = document.createElement(name), { dataset, ...fields } = more;
  made.append(...(Array.isArray(content) ? content : [content]));
  Object.assign(made, fields);
  Object.assign(made.dataset, dataset || {});
  return made;
}
function makeButton(words, act, name) {
  const button = element("button", words, { type: "button", ...(name && { title: name, ariaLabel: name }) });
  button.addEventListener("click", (event) => act(button, event));
  return button;
}
const makeBox = (name, parent) => parent.appendChild(element("div", "", { className: name }));
// Copy a text to the clipboard, even from a page that was opened from the disk.
async function copyText(text) {
  if (navigator.clipboard && isSecureContext) {
    try { await navigator.clipboard.writeText(text); return true; } catch { /* not allowed: use execCommand below */ }
  }
  const area = element("textarea", "", { value: text });
  area.style.cssText = "position: fixed; opacity: 0;";
  document.body.append(area);
  area.select();
  const done = document.execCommand("copy");
  area.remove();
  return done;
}

// Entries of each panel's legend, each label once; a single series needs none, and a panel that shows nothing else than
// one above it in the same looks has none of its own.
function legendsOf(chart, dark) {
  const shown = new Set();
  return chart.panels.map((panel) => {
    const entries = new Map(), looks = looksOf(panel, dark);
    for (const [i, s] of panel.series.entries()) if (!entries.has(s.label)) entries.set(s.label, { label: s.label, role: s.role, look: looks[i], line: s.line, winds: s.winds, band: s.role === "band" });
    const names = [...entries.values()].map(({ label, role, look }) => `${label} ${role} ${look.colour} ${look.dash}`);
    if (entries.size < 2 || names.every((name) => shown.has(name))) return [];
    for (const name of names) shown.add(name);
    return [...entries.values()].sort((a, b) => RANK[a.role] - RANK[b.role]);
  });
}
function drawKey(ctx, entry, x, y, px) {
  ctx.strokeStyle = ctx.fillStyle = entry.look.colour;
  ctx.lineWidth = 1.6 * px;
  if (entry.band) { ctx.globalAlpha = entry.look.opacity; ctx.fillRect(x, y - 4 * px, 24 * px, 8 * px); ctx.globalAlpha = 1; return; }
  if (!entry.line) { drawMarker(ctx, entry.look.marker, x + 12 * px, y, 2.6 * px); return; }
  ctx.setLineDash(dashOf(entry, entry.look, px));
  ctx.beginPath();
  ctx.moveTo(x, y);
  ctx.lineTo(x + 24 * px, y);
  ctx.stroke();
  ctx.setLineDash([]);
}

// The numbers of x stand below the last of neighbouring panels that share them.
const isBare = (chart, i) => i + 1 < chart.panels.length && chart.panels[i + 1].x_label === chart.panels[i].x_label && !chart.panels[i].equal;
const heightOf = (chart, i) => Math.round(90 * chart.panels[i].height) + (isBare(chart, i) ? 12 : 50);

// A whole chart with its buttons, its legend and what stands under the cursor.
class Chart {
  constructor(box, chart) {
    this.box = box;
    this.chart = chart;
    this.hidden = new Set();
    this.bar = makeBox("bar", box);
    this.bar.setAttribute("role", "toolbar");
    this.bar.ariaLabel = "zoom and view";
    this.value = element("output", "", { className: "value" });
    this.hint = this.value.textContent = matchMedia("(hover: none)").matches ? "Tap: read a value. Buttons: zoom and move." : "Drag: zoom. Shift and drag: move. Double-click: all.";
    const group = { left: 0 }, more = { hidden: this.hidden, group, joined: false, keep: true };
    this.legends = [];
    this.panels = chart.panels.map((panel, i) => {
      const bare = isBare(chart, i), legend = makeBox("legend", box), place = makeBox("panel", box);
      this.legends.push(legend);
      place.style.setProperty("--height", `${heightOf(chart, i)}px`);
      if (panel.equal) place.style.maxWidth = `${heightOf(chart, i) + 40}px`;
      place.setAttribute("role", "img");
      place.ariaLabel = `${chart.title}: ${panel.label} against ${panel.x_label}`;
      const hooks = { setSelect: [(plot) => this.select(plot, panel.x_label)], setCursor: [() => { if (this.over === i) this.value.textContent = this.panels[i].read() || this.hint; }] };
      const cursor = { points: { show: false }, sync: { key: `${box.id || chart.name}-${panel.x_label}`, setSeries: false }, drag: { x: true, y: false, setScale: false } };
      place.addEventListener("pointerenter", () => { this.over = i; });
      return new Panel(place, panel, { ...more, hooks, cursor, bare });
    });
    box.append(this.value);
    this.redraw(true);
    this.spans = new Map();
    for (const { panel, span } of this.panels) {
      const [low, high] = this.spans.get(panel.x_label) || span;
      this.spans.set(panel.x_label, [Math.min(low, span[0]), Math.max(high, span[1])]);
    }
    this.act("all");
    for (const [action, sign, words] of [["in", "+", "zoom in"], ["out", "−", "zoom out"], ["left", "←", "move left"], ["right", "→", "move right"], ["all", "All", "show all"]]) this.bar.append(makeButton(sign, () => this.act(action), words));
    if (chart.panels.some((panel) => panel.log !== null && panel.log !== undefined)) this.bar.append(this.toggle("Log axis", this.panels.some((panel) => panel.log), (on) => this.switchLog(on)));
    if (chart.panels[0].series.some((s) => s.role === "data" && !s.line && !s.u && s.x.length > 50)) this.bar.append(this.toggle("Lines", false, (on) => { for (const panel of this.panels) panel.more.joined = on; this.redraw(); }));
    this.bar.append(makeButton("Save figure", () => this.save()));
    this.showLegend();
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.showLegend());
    for (const panel of this.panels) this.follow(panel);
  }

  toggle(words, pressed, act) {
    const button = makeButton(words, () => { const on = button.getAttribute("aria-pressed") !== "true"; button.setAttribute("aria-pressed", String(on)); act(on); });
    button.setAttribute("aria-pressed", String(pressed));
    return button;
  }

  switchLog(on) {
    for (const panel of this.panels) if (panel.panel.log !== null && panel.panel.log !== undefined) { panel.log = on; panel.build(); }
  }

  redraw(axes = false) { for (const panel of this.panels) panel.plot.redraw(false, axes); }

  showLegend() {
    for (const [i, entries] of legendsOf(this.chart, isDark(this.box)).entries()) this.legends[i].replaceChildren(...entries.map((entry) => this.entry(entry)));
  }

  // An entry of a legend is a button that hides and shows its series.
  entry(entry) {
    const button = this.toggle(entry.label, !this.hidden.has(entry.label), (on) => { if (on) this.hidden.delete(entry.label); else this.hidden.add(entry.label); this.redraw(); });
    const px = devicePixelRatio, key = element("canvas", "", { width: 24 * px, height: 12 * px });
    drawKey(key.getContext("2d"), entry, 0, 6 * px, px);
    button.prepend(key);
    return button;
  }

  // The listeners are on the box, because a panel that is rebuilt for another colour scheme has a new canvas.
  follow(panel) {
    const { box } = panel, name = panel.panel.x_label;
    box.addEventListener("wheel", (event) => {
      if (!event.ctrlKey && !event.metaKey) return;  // otherwise the page scrolls
      event.preventDefault();
      this.act(event.deltaY < 0 ? "in" : "out");
    }, { passive: false });
    let from = null;
    box.addEventListener("pointerdown", (event) => { if (event.shiftKey) { from = [event.clientX, ...this.range(name)]; event.preventDefault(); event.stopPropagation(); } }, true);
    box.addEventListener("pointermove", (event) => {
      if (from === null) return;
      const [x, low, high] = from, by = (x - event.clientX) / Math.max(panel.plot.over.clientWidth, 1) * (high - low);
      this.show(name, [low + by, high + by]);
    });
    for (const end of ["pointerup", "pointerleave"]) box.addEventListener(end, () => { from = null; });
    box.addEventListener("dblclick", () => this.act("all"));
    box.addEventListener("click", (event) => {
      const detail = panel.pointAt(event.clientX, event.clientY);
      if (detail) box.dispatchEvent(new CustomEvent("point", { bubbles: true, detail }));
    });
    box.addEventListener("pointerleave", () => { this.value.textContent = this.hint; });
  }

  select(plot, name) {
    if (plot.select.width < 4) return;
    const range = [plot.select.left, plot.select.left + plot.select.width].map((at) => plot.posToVal(at, "x"));
    plot.setSelect({ left: 0, width: 0, top: 0, height: 0 }, false);
    this.show(name, range);
  }

  range(name) {
    const { min, max } = this.panels.find(({ panel }) => panel.x_label === name).plot.scales.x;
    return [min, max];
  }

  act(action) {
    for (const [name, span] of this.spans) {
      const all = this.panels.find(({ panel }) => panel.x_label === name);
      if (all.panel.equal && action === "all") { for (const panel of this.panels) { panel.more.range = null; panel.show(panel.panel); } }
      else this.show(name, shifted(action === "all" ? span : this.range(name), all.panel.equal ? all.ranges().x : span, action));
    }
  }

  show(name, range) {
    for (const panel of this.panels) {
      if (panel.panel.x_label !== name) continue;
      panel.more.range = range;
      if (panel.panel.zero) panel.show(panel.panel); else panel.plot.setScale("x", { min: range[0], max: range[1] });
    }
  }

  async save() {
    const canvas = await paper(this.chart, 720, 4, this);
    element("a", "", { href: canvas.toDataURL("image/png"), download: `${this.chart.file || this.chart.name}.png` }).click();
  }
}

// Draw a chart as it is seen, in light colours and with ``times`` as many pixels, on a canvas for print or a file.
async function paper(chart, width, times, seen = null) {
  const scale = times / devicePixelRatio, holder = makeBox("", document.body), canvas = document.createElement("canvas"), ctx = canvas.getContext("2d");
  holder.style.cssText = "position: fixed; left: -99999px; top: 0;";
  const group = { left: 0 }, hidden = seen ? seen.hidden : new Set();
  const panels = chart.panels.map((panel, i) => {
    const own = seen && seen.panels[i], { min, max } = own ? own.plot.scales.x : {};
    const more = { scale, dark: false, bare: isBare(chart, i), group, hidden, joined: own ? own.more.joined : false, size: { width: width * scale, height: heightOf(chart, i) * scale } };
    const made = new Panel(holder, { ...panel, log: own && panel.log !== null ? own.log : panel.log }, own && !panel.equal ? { ...more, range: [min, max] } : more);
    return made;
  });
  await null;  // uPlot draws in a microtask
  for (const panel of panels) if (panel.panel.equal) panel.show(panel.panel); else panel.plot.redraw(false, true);
  await null;
  const font = `${12 * times}px ${FONT}`, line = 18 * times;
  ctx.font = font;
  const legends = legendsOf(chart, false).map((entries) => {
    const rows = [[]];
    for (const entry of entries.filter(({ label }) => !hidden.has(label))) {
      entry.wide = ctx.measureText(entry.label).width + 46 * times;
      if (rows.at(-1).reduce((sum, each) => sum + each.wide, entry.wide) > width * times && rows.at(-1).length) rows.push([]);
      rows.at(-1).push(entry);
    }
    return rows.filter((row) => row.length);
  });
  canvas.width = width * times;
  canvas.height = panels.reduce((sum, { plot }, i) => sum + line * legends[i].length + plot.ctx.canvas.height, 0);
  ctx.fillStyle = "#ffffff";
  ctx.fillRect(0, 0, canvas.width, canvas.height);
  ctx.font = font;
  ctx.textBaseline = "middle";
  let y = 0;
  for (const [i, { plot }] of panels.entries()) {
    for (const row of legends[i]) {
      let x = 8 * times;
      for (const entry of row) {
        drawKey(ctx, entry, x, y + line / 2, times);
        ctx.fillStyle = "#1d232a";
        ctx.fillText(entry.label, x + 30 * times, y + line / 2);
        x += entry.wide;
      }
      y += line;
    }
    ctx.drawImage(plot.ctx.canvas, 0, y);
    y += plot.ctx.canvas.height;
    plot.destroy();
  }
  holder.remove();
  return canvas;
}
