"use strict";
// The cursor, the pin and the selection belong to samples: they keep their times while the chart moves on.
let pinned = null, cursor = null, cursor_on = false, selection = null, region = null, dragged = false;

// Redraw the layers above the samples, even while the samples are frozen; a chart without samples has no axes yet.
function redraw() { if (position) position.plot.redraw(false); }

function forget_selection() {
  pinned = cursor = selection = region = null;
  show_cursor();
  show_selection();
}

// The sample nearest to a time as [time, shown value]; null if its value is missing.
function sample_at(time) {
  const all = samples[0];
  if (!all || !all.count) return null;
  let i = Math.min(all.at(time), all.count - 1);
  if (i > 0 && time - all.t[i - 1] < all.t[i] - time) i -= 1;
  return Number.isNaN(all.y[i]) ? null : [all.t[i], (all.y[i] - zero()) * scale()];
}

function show_cursor() {
  if (!cursor && !pinned) { $("cursor").textContent = ""; return; }
  const [t, y] = cursor || pinned;
  let text = `${t.toFixed(3)} s, ${y.toFixed(3)} ${unit()}`;
  if (pinned && cursor && pinned[0] !== t) {
    const time = t - pinned[0], way = y - pinned[1];
    text += `; from the pin at ${pinned[0].toFixed(3)} s: ${time.toFixed(3)} s, ${way.toFixed(3)} ${unit()}, slope ${(way / time).toFixed(2)} ${unit()}/s, 1/time ${Math.abs(1 / time).toFixed(4)} Hz`;
  } else if (pinned) text += "; pinned: move the cursor to read differences";
  $("cursor").textContent = signed(text);
}

function set_cursor(sample) { cursor = sample || cursor; show_cursor(); redraw(); }

function pin() { pinned = cursor || pinned; show_cursor(); redraw(); }

// A step is one sample, or one pixel if samples are denser than pixels.
function move_cursor(steps) {
  const all = samples[0];
  if (!all || !all.count) return;
  const [from, end] = in_view(), first = all.at(from), last = Math.max(first, Math.min(all.count - 1, all.at(end)));
  const step = Math.max(1, Math.round((last - first) / position.plot.over.clientWidth));
  const before = cursor ? all.at(cursor[0]) : Math.round((first + last) / 2);
  const i = Math.min(last, Math.max(first, before + steps * step));
  set_cursor(sample_at(all.t[i]) || [all.t[i], NaN]);
}

function select_between(from, to) {
  selection = { from: Math.min(from, to), to: Math.max(from, to) };
  region = null;
  show_selection();
  ask_server({ type: "region", ...selection });
}

// The usual statistics of the measured samples in a selection; the slope is that of a least-squares line.
function statistics({ from, to }) {
  const all = samples[0];
  let n = 0, sum = 0, sum_t = 0, least = Infinity, most = -Infinity;
  const first = all.at(from), each = (call) => { for (let i = first; i < all.count && all.t[i] <= to; i++) if (!Number.isNaN(all.y[i])) call(all.t[i], all.y[i]); };
  each((t, y) => { n += 1; sum += y; sum_t += t; least = Math.min(least, y); most = Math.max(most, y); });
  if (!n) return { n };
  const mean = sum / n, mean_t = sum_t / n;
  let yy = 0, tt = 0, ty = 0;
  each((t, y) => { yy += (y - mean) ** 2; tt += (t - mean_t) ** 2; ty += (t - mean_t) * (y - mean); });
  return { n, mean, deviation: n > 1 ? Math.sqrt(yy / (n - 1)) : NaN, least, most, slope: tt > 0 ? ty / tt : NaN };
}

const pair = (term, detail) => element("div", [element("dt", term), element("dd", signed(detail))]);

function show_selection() {
  $("region").hidden = !selection;
  redraw();
  if (!selection) return;
  $("region-title").textContent = `Selection ${selection.from.toFixed(2)} to ${selection.to.toFixed(2)} s`;
  const found = statistics(selection), k = scale(), z = zero(), as = (y) => `${((y - z) * k).toFixed(3)} ${unit()}`;
  const rows = [["samples", String(found.n)]];
  if (found.n) rows.push(["mean", as(found.mean)], ["standard deviation", `${(found.deviation * k).toFixed(3)} ${unit()}`], ["minimum", as(found.least)], ["maximum", as(found.most)], ["slope", `${(found.slope * k).toFixed(3)} ${unit()}/s`]);
  $("statistics").replaceChildren(...rows.map(([name, value]) => pair(name, value)));
  show_region_fits();
}

// Show the fits of the selection and of all samples side by side.
function show_region_fits() {
  const part = (region && region.estimates) || {}, whole = (motion && motion.estimates) || {};
  $("region-why").textContent = region ? region.why || "" : "Fitting the selection ...";
  $("region-other").textContent = run.source === "REPLAY" || is_over() ? "Whole run" : "All samples so far";
  const names = Object.keys(LABELS).filter((name) => part[name]);
  $("region-fits").hidden = !names.length;
  $("region-estimates").replaceChildren(...names.map((name) => {
    const head = element("th", name === "amplitude_now" ? "amplitude at the end" : LABELS[name], { scope: "row" });
    return element("tr", [head, ...[part, whole].map((from) => element("td", from[name] ? short(from[name]) : ""))], { dataset: { name } });
  }));
}

function show_region(found) {
  if (!selection || found.from !== selection.from || found.to !== selection.to) return;
  region = found;
  show_region_fits();
  redraw();
  say(`${$("region-title").textContent}: ${found.estimates && found.estimates.period ? `period ${short(found.estimates.period)}` : found.why}`);
}

// uPlot's own box is removed after the drag; the selection is then drawn at its times.
function selected(plot) {
  const { left, width } = plot.select;
  if (width < 8) return;
  dragged = true;
  plot.setSelect({ left: 0, width: 0, top: 0, height: 0 }, false);
  select_between(plot.posToVal(left, "x"), plot.posToVal(left + width, "x"));
}

function draw_selection(plot) {
  const { ctx, bbox } = plot, { min, max } = plot.scales.x;
  if (!selection || selection.to < min || selection.from > max) return;
  const left = plot.valToPos(Math.max(selection.from, min), "x", true), right = plot.valToPos(Math.min(selection.to, max), "x", true);
  ctx.save();
  ctx.globalAlpha = 0.15;
  ctx.fillStyle = lookOf("other", 2, position.dark).colour;
  ctx.fillRect(left, bbox.top, right - left, bbox.height);
  ctx.restore();
}

function draw_cursors(plot) {
  const { ctx, bbox } = plot, { min, max } = plot.scales.x;
  ctx.save();
  ctx.lineWidth = devicePixelRatio;
  for (const [sample, name] of [[pinned, "other"], [cursor, "law"]]) {
    if (!sample || sample[0] < min || sample[0] > max) continue;
    const x = plot.valToPos(sample[0], "x", true), y = plot.valToPos(sample[1], "y", true);
    ctx.strokeStyle = ctx.fillStyle = lookOf(name, 0, position.dark).colour;
    ctx.setLineDash(name === "law" ? [3, 3] : []);
    ctx.beginPath();
    ctx.moveTo(x, bbox.top);
    ctx.lineTo(x, bbox.top + bbox.height);
    ctx.stroke();
    ctx.setLineDash([]);
    if (y < bbox.top || y > bbox.top + bbox.height) continue;
    ctx.beginPath();
    ctx.arc(x, y, 4 * devicePixelRatio, 0, 2 * Math.PI);
    ctx.stroke();
  }
  ctx.restore();
}

// The mouse moves the cursor, a click pins it, and a drag selects; on a touch screen, a tap moves and pins the cursor,
// and a sideways drag selects.
let touch_from = null;
const over_chart = (event) => event.target.classList.contains("u-over");
const along = (event) => event.clientX - event.target.getBoundingClientRect().left;
const time_under = (event) => position.plot.posToVal(along(event), "x");
$("position").addEventListener("pointerdown", (event) => {
  dragged = false;
  if (over_chart(event) && event.pointerType !== "mouse") touch_from = along(event);
});
$("position").addEventListener("pointermove", (event) => {
  if (!over_chart(event)) return;
  if (event.pointerType === "mouse") { if (!event.buttons) set_cursor(sample_at(time_under(event))); return; }
  if (touch_from === null) return;
  const x = along(event), { plot } = position;
  plot.setSelect({ left: Math.min(x, touch_from), width: Math.abs(x - touch_from), top: 0, height: plot.over.clientHeight }, false);
});
$("position").addEventListener("pointerup", (event) => {
  if (!over_chart(event) || touch_from === null) return;
  const x = along(event), from = touch_from, { plot } = position;
  touch_from = null;
  plot.setSelect({ left: 0, width: 0, top: 0, height: 0 }, false);
  if (Math.abs(x - from) >= 8) { select_between(plot.posToVal(from, "x"), plot.posToVal(x, "x")); return; }
  set_cursor(sample_at(time_under(event)));
  pin();
});
$("position").addEventListener("pointercancel", () => { touch_from = null; });
$("position").addEventListener("click", (event) => {
  if (event.pointerType === "touch" || !over_chart(event) || dragged) return;
  set_cursor(sample_at(time_under(event)));
  pin();
});
$("region-clear").addEventListener("click", () => { selection = region = null; show_selection(); });
