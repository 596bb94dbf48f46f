"use strict";
// Numbers, charts, cursors.
const WINDOWS = [5, 10, 30, 60, 300, Infinity];
const LABELS = { period: "period", amplitude_now: "amplitude now", spring_constant: "spring constant k", damping_rate: "damping rate", noise: "noise", offset: "rest position", quality_factor: "quality factor", sample_rate: "sampling rate", drop_outs: "drop-outs" };
const KINDS = { voltage: "voltage", angle: "angle", acceleration: "acceleration", force: "force", length: "position" };
let position, amplitude, phase, spectrum, shown_zero;
let frozen = false, fixed = false, window_index = 1, playing = false, play_time = null, play_moment = 0, pinned = null;

function begin_anew() {
  shown_zero = bench().rest_m;
  pinned = null;
  play_time = null;
  if (run.source === "REPLAY") window_index = WINDOWS.length - 1, show_window();
  const what = `${shown_zero === undefined ? KINDS[run.quantity] || run.quantity : "displacement"} / ${unit()}`;
  if (position) for (const chart of [position, amplitude, phase, spectrum]) chart.destroy();
  const select = { cursor: { drag: { x: true, y: false, setScale: false } }, hooks: { setSelect: [selected], setCursor: [pointed], draw: [draw_marks] } };
  position = new Chart("position", [{ label: "samples", stroke: COLOURS.data, width: 1, points: { show: false } }, line("fit", COLOURS.fit), line("rest", COLOURS.rest, [6, 4], 1)], ["time / s", what], select);
  amplitude = new Chart("amplitude", [points("amplitude")], ["time / s", `amplitude / ${unit()}`]);
  phase = new Chart("phase", [{ label: "velocity", stroke: COLOURS.data, points: { show: true, size: 3, fill: COLOURS.data }, paths: () => null }], [what, `velocity / (${unit()}/s)`]);
  spectrum = new Chart("spectrum", [line("amplitude", COLOURS.data, null, 1)], ["frequency / Hz", `amplitude / ${unit()}`], { scales: { x: { time: false }, y: { distr: 3 } } });
  if (motion) show_motion();
  dirty = true;
}

const signed = (text) => text.replaceAll("-", "−");

// Value and uncertainty as people write them: two digits of the uncertainty in brackets.
function short(estimate) {
  let { value, u, unit: name } = estimate, factor = 1;
  const prefixes = { m: [1e3, "mm"], s: [1, "s"] };
  if (prefixes[name]) [factor, name] = prefixes[name];
  value *= factor;
  if (u === null || !(u > 0)) return signed(`${Number(value.toPrecision(5))} ${name}`);
  u *= factor;
  let digits = 1 - Math.floor(Math.log10(u));
  if (Math.round(u * 10 ** digits) >= 100) digits -= 1;
  if (digits <= 0) return signed(`${value.toFixed(0)}(${u.toFixed(0)}) ${name}`);
  if (digits > 7) return signed(`${value.toExponential(3)} ± ${u.toExponential(1)} ${name}`);
  const bracket = digits === 1 && u >= 1 ? u.toFixed(1) : String(Math.round(u * 10 ** digits));
  return signed(`${value.toFixed(digits)}(${bracket}) ${name}`);
}

function list(box, estimates) {
  box.replaceChildren(...Object.entries(LABELS).filter(([name]) => estimates[name]).map(([name, label]) => {
    const group = document.createElement("div"), term = document.createElement("dt"), detail = document.createElement("dd");
    term.textContent = label;
    detail.textContent = short(estimates[name]);
    detail.title = estimates[name].text;
    group.append(term, detail);
    return group;
  }));
}

function show_motion() {
  $("why").textContent = motion.why || "";
  list($("estimates"), motion.estimates || {});
  $("stopping").textContent = motion.stop ? stopping(motion.stop) : "";
  $("telling").textContent = motion.stop && motion.stop.laws ? telling(motion.stop.laws) : "";
  $("findings").replaceChildren(...(motion.findings || []).map((f) => item(f.advice ? `${f.message}. ${f.advice}` : f.message, f.severity)));
  if (!(motion.findings || []).length) $("findings").replaceChildren(item(motion.count ? "nothing to say" : "nothing yet"));
  if (motion.amplitude) {
    const laws = motion.laws, times = motion.amplitude.t;
    const series = [points("amplitude"), ...laws.map((law, i) => line(law.name, law.name === motion.law ? COLOURS.fit : COLOURS.others[i % 4], law.name === motion.law ? null : DASHES[i % 4]))];
    if (series.map((s) => s.label).join() !== amplitude.series.map((s) => s.label).join()) amplitude.build(series);
    const k = scale();
    const columns = [[times, motion.amplitude.value.map((x) => x * k)], ...laws.map((law) => [law.t, law.value.map((x) => x * k)])];
    amplitude.show(uPlot.join(columns));
  }
  if (motion.spectrum && motion.spectrum.f.length) spectrum.show([motion.spectrum.f.slice(1), motion.spectrum.value.slice(1).map((x) => x * scale())]);
}

const seconds = (s) => (s === null ? "long" : s < 10 ? s.toFixed(1) : s.toFixed(0));

function stopping(stop) {
  const wanted = `u(T) = ${(stop.wanted_u_s * 1e6).toFixed(0)} µs`;
  const interval = `Whenever you stop, T lies in ${stop.low.toFixed(6)} to ${stop.high.toFixed(6)} s with ${(100 * stop.covers).toFixed(0)} %.`;
  if (stop.more_s === 0) return `${interval} ${wanted} is reached.`;
  if (stop.u_clock_s >= stop.wanted_u_s) return `${interval} ${wanted} is out of reach: the sensor's clock alone leaves ${(stop.u_clock_s * 1e6).toFixed(0)} µs.`;
  if (stop.more_s === null) return `${interval} ${wanted} is out of reach for this swing.`;
  return `${interval} About ${seconds(stop.more_s)} s more for ${wanted}.`;
}

function telling(need) {
  const pair = `${need.law} from ${need.rival} drag`;
  if (need.told && !["linear", "quadratic"].includes(motion.law)) return `Neither linear nor quadratic drag alone: ${motion.law}.`;
  if (need.told) return `The record tells ${pair}.`;
  if (need.median_s === null) return `To tell ${pair} takes more than twenty times as long as so far.`;
  return `About ${seconds(need.median_s)} s more to tell ${pair} (${seconds(need.low_s)} to ${need.high_s === null ? "much more" : `${seconds(need.high_s)} s`}, 8 times in 10).`;
}

function show_region(found) {
  $("region").hidden = false;
  $("region-title").textContent = `Region ${found.from.toFixed(2)} to ${found.to.toFixed(2)} s`;
  list($("region-estimates"), found.estimates || {});
  $("region-why").textContent = found.why || "";
  say(`${$("region-title").textContent}: ${found.estimates && found.estimates.period ? `period ${short(found.estimates.period)}` : found.why}`);
}

function fit_between(from, to) { ask_server({ type: "region", from: Math.min(from, to), to: Math.max(from, to) }); }

function selected(plot) {
  const { left, width } = plot.select;
  if (width < 8) return;
  fit_between(plot.posToVal(left, "x"), plot.posToVal(left + width, "x"));
}

// A mark is a dashed line with its text, as far as it lies in view.
function draw_marks(plot) {
  if (!state) return;
  const { ctx, bbox } = plot, { min, max } = plot.scales.x;
  ctx.save();
  ctx.strokeStyle = ctx.fillStyle = COLOURS.others[1];
  ctx.setLineDash([4, 4]);
  ctx.font = `${11 * devicePixelRatio}px system-ui`;
  for (const [t, text] of state.marks) {
    if (t < min || t > max) continue;
    const x = plot.valToPos(t, "x", true);
    ctx.beginPath();
    ctx.moveTo(x, bbox.top);
    ctx.lineTo(x, bbox.top + bbox.height);
    ctx.stroke();
    const far = x > bbox.left + bbox.width / 2;
    ctx.textAlign = far ? "right" : "left";
    ctx.fillText(text.slice(0, 30), x + (far ? -4 : 4), bbox.top + 12 * devicePixelRatio);
  }
  ctx.restore();
}

// The cursor: by the mouse, a finger, or the arrow keys once X has put it there. A click or Enter pins it.
let cursor_on = false;
function at_cursor() {
  const { idx } = position.plot.cursor;
  if (idx === null || idx === undefined || position.plot.data[1][idx] == null) return null;
  return [position.plot.data[0][idx], position.plot.data[1][idx]];
}

function pointed() {
  const here = position && position.plot && at_cursor();
  if (!here) { $("cursor").textContent = ""; return; }
  const [t, y] = here;
  let text = `${t.toFixed(3)} s, ${y.toFixed(3)} ${unit()}`;
  if (pinned) text += `; from the pin: ${(t - pinned[0]).toFixed(3)} s, ${(y - pinned[1]).toFixed(3)} ${unit()}, slope ${((y - pinned[1]) / (t - pinned[0])).toFixed(2)} ${unit()}/s`;
  $("cursor").textContent = text;
}

function pin() { pinned = at_cursor() || pinned; pointed(); }

function move_cursor(steps) {
  const { plot } = position, last = plot.data[0].length - 1;
  if (last < 0) return;
  const before = plot.cursor.idx == null || plot.cursor.left < 0 ? Math.round(last / 2) : plot.cursor.idx;
  const idx = Math.min(last, Math.max(0, before + steps));
  const y = plot.data[1][idx];
  plot.setCursor({ left: plot.valToPos(plot.data[0][idx], "x"), top: y == null ? 0 : plot.valToPos(y, "y") });
}

// uPlot knows the mouse; a finger taps to point and pin, and draws to the side to have a part fitted.
let touch_from = null;
const over_chart = (event) => event.pointerType !== "mouse" && event.target.classList.contains("u-over");
const along = (event) => event.clientX - event.target.getBoundingClientRect().left;
$("position").addEventListener("pointerdown", (event) => { if (over_chart(event)) touch_from = along(event); });
$("position").addEventListener("pointermove", (event) => {
  if (!over_chart(event) || touch_from === null) return;
  const x = along(event), { plot } = position;
  plot.setSelect({ left: Math.min(x, touch_from), width: Math.abs(x - touch_from), top: 0, height: plot.over.clientHeight }, false);
});
$("position").addEventListener("pointerup", (event) => {
  if (!over_chart(event) || touch_from === null) return;
  const x = along(event), from = touch_from, { plot } = position;
  touch_from = null;
  if (Math.abs(x - from) >= 8) { fit_between(plot.posToVal(from, "x"), plot.posToVal(x, "x")); return; }
  plot.setCursor({ left: x, top: 0 });
  pin();
});
$("position").addEventListener("pointercancel", () => { touch_from = null; });
$("position").addEventListener("click", (event) => { if (event.pointerType !== "touch") pin(); });

function end_time() {
  const all = samples[0];
  if (!all || !all.count) return 0;
  return play_time !== null ? play_time : all.t[all.count - 1];
}

function in_view() {
  const all = samples[0], span = WINDOWS[window_index], end = end_time();
  return [span === Infinity ? (all.count ? all.t[0] : 0) : end - span, end];
}

function fit_at(t) {
  const fit = motion && motion.fit;
  if (!fit || t < fit.moment - 20 || play_time !== null) return null;
  return fit.rest + fit.amplitude * decay(fit.decay, t - fit.moment) * Math.cos(fit.omega * (t - fit.moment) + fit.phase);
}

// What the damping law leaves of the last window's amplitude so many seconds from it.
function decay({ from, step, value }, after) {
  const at = Math.min(Math.max((after - from) / step, 0), value.length - 1), low = Math.min(Math.floor(at), value.length - 2);
  return value[low] + (at - low) * (value[low + 1] - value[low]);
}

function step_play() {
  const now = performance.now(), all = samples[0], last = all.t[all.count - 1];
  play_time += ((now - play_moment) / 1e3) * Number($("speed").value);
  play_moment = now;
  if (play_time > last) {
    if ($("loop").checked) play_time = all.t[0]; else { play_time = last; play(); }
  }
  $("time").value = (play_time - all.t[0]) / (last - all.t[0]);
}

function draw() {
  requestAnimationFrame(draw);
  if (!run || !samples[0] || !position || document.hidden) return;
  if (playing) step_play();
  if (frozen || !(dirty || playing)) return;
  dirty = false;
  const [from, end] = in_view(), all = samples[0];
  const [t, y] = all.between(from, end, Math.max(200, $("position").clientWidth));
  const k = scale(), z = zero(), shown = (v) => (v === null ? null : (v - z) * k);
  const close = t.length && t[t.length - 1] - t[0] < 40;
  const fit = t.map((x) => (close ? shown(fit_at(x)) : null));
  const rest = t.map(() => (motion && motion.rest_m !== undefined ? shown(motion.rest_m) : null));
  const keep = fixed ? { ...position.plot.scales.y } : null;
  position.show([t, y.map(shown), fit, rest]);
  if (keep && keep.min != null) position.plot.setScale("y", { min: keep.min, max: keep.max });
  const swing = motion && motion.omega ? (2 * Math.PI) / motion.omega : 1;
  const reach = Math.max(1, Math.round((swing / 40) * run.rate_hz));
  const orbit = all.orbit(end - 3 * swing, end, reach).sort((a, b) => a[0] - b[0]);
  phase.show([orbit.map(([p]) => shown(p)), orbit.map(([, v]) => v * k)]);
}
