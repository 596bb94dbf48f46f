"use strict";
// Numbers with their age, and the four charts.
const WINDOWS = [5, 10, 30, 60, 300, Infinity];
const LABELS = { period: "period", amplitude_now: "amplitude now", spring_constant: "spring constant k", damping_rate: "damping rate", noise: "noise", offset: "rest position", quality_factor: "quality factor" };
// Estimates that depend on the damping law, which may be stated.
const OF_LAW = new Set(["damping_rate", "quality_factor"]);
const KINDS = { voltage: "voltage", angle: "angle", acceleration: "acceleration", force: "force", length: "position" };
const FRESH_S = 2;
let position, amplitude, phase, spectrum, shown_zero, named = "";
let frozen = false, fixed = false, window_index = 1, playing = false, play_time = null, play_moment = 0;

function begin_anew() {
  shown_zero = bench().rest_m;
  play_time = null;
  if (run.source === "REPLAY") window_index = WINDOWS.length - 1, show_window();
  const what = `${shown_zero === undefined ? KINDS[run.quantity] || run.quantity.replaceAll("_", " ") : "displacement"} / ${unit()}`;
  if (position) for (const chart of [position, amplitude, phase, spectrum]) chart.destroy();
  // The page's own cursor stays at its sample; uPlot's cursor stays at its place on the screen, so it is turned off.
  const select = { cursor: { x: false, y: false, points: { show: false }, drag: { x: true, y: false, setScale: false } }, hooks: { setSelect: [selected], drawAxes: [draw_selection, draw_fits], draw: [draw_cursors] } };
  const still = { cursor: { show: false } }, make = (id, label, x_label, more, shape) => new Panel($(id), { label, x_label, log: null, series: [], ...shape }, more);
  position = make("position", what, "time / s", select);
  amplitude = make("amplitude", `amplitude / ${unit()}`, "time / s", still);
  phase = make("phase", `velocity / (${unit()}/s)`, what, still, { equal: true });
  spectrum = make("spectrum", `amplitude / ${unit()}`, "frequency / Hz", still, { log: true });
  forget_selection();
  for (const shown of [amplitude, spectrum]) show_chart(shown, null);
  show_motion();
  dirty = true;
}

const signed = (text) => text.replaceAll("-", "−");

// Value and uncertainty in the usual notation, with two digits of the uncertainty in brackets.
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

// Time advances between messages during a recording, but not after it.
const is_over = () => run.source === "REPLAY" || state.ended;
function last_time() { const all = samples[0]; return all && all.count ? all.t[all.count - 1] : 0; }
const now_s = () => last_time() + (!state || is_over() ? 0 : (performance.now() - came_at) / 1e3);

const label_of = (name) => (name === "amplitude_now" && is_over() ? "amplitude at the end" : LABELS[name]);

function show_motion() {
  if (!motion) return;
  $("why").textContent = motion.why || "";
  const estimates = motion.estimates || {};
  $("estimates").replaceChildren(...Object.keys(LABELS).filter((name) => estimates[name]).map((name) => {
    const group = pair(label_of(name) + (OF_LAW.has(name) && motion.stated_law ? `, law ${motion.stated_law}` : ""), short(estimates[name])), detail = group.lastChild;
    detail.title = estimates[name].text;
    group.dataset.name = name;
    group.dataset.t = estimates[name].t_s || motion.t_s;
    detail.append(element("span", "", { className: "age" }));
    return group;
  }));
  show_ages();
  const findings = (motion.findings || []).map((f) => item(f.advice ? `${f.message.replace(/\.$/, "")}. ${f.advice}` : f.message, f.severity));
  $("findings").replaceChildren(...(findings.length ? findings : [item(motion.count ? "No warnings." : "No analysis yet.")]));
  for (const shown of [amplitude, spectrum]) show_chart(shown, motion.charts && motion.charts[shown.box.id]);
  if (selection) show_region_fits();
}

// Numbers older than two seconds are grey and show their age; this is updated four times a second.
function show_ages() {
  if (!run || !state || !motion) return;
  const at = now_s();
  for (const group of $("estimates").children) {
    const age = at - Number(group.dataset.t), old = age > FRESH_S;
    group.classList.toggle("stale", old);
    group.querySelector(".age").textContent = old ? `${age.toFixed(0)} s old` : "";
  }
  $("tier").textContent = !motion.accuracy ? "" : motion.accuracy === "standard" ? "Standard accuracy, whole run." : "Fast accuracy while the run goes on; the report uses standard accuracy.";
  const forecast = motion.stop && !is_over() && bench().phase === "recording" && motion.t_s !== undefined;
  $("stopping").textContent = forecast ? stopping(motion.stop, at - motion.t_s) : "";
  $("stopping").classList.toggle("stale", forecast && at - motion.t_s > FRESH_S);
  $("why").classList.toggle("stale", !is_over() && at - motion.t_s > FRESH_S);
}
setInterval(() => { if (run && state) { show_ages(); show_rate(); } }, 250);

const seconds = (s) => (s < 10 ? s.toFixed(1) : s.toFixed(0));

function stopping(stop, age_s) {
  const wanted = `u(T) = ${(stop.wanted_u_s * 1e6).toFixed(0)} µs`;
  if (stop.more_s === 0) return `${wanted} is reached.`;
  if (stop.u_clock_s >= stop.wanted_u_s) return `${wanted} is out of reach: the uncertainty of the sensor's clock alone is ${(stop.u_clock_s * 1e6).toFixed(0)} µs.`;
  if (stop.more_s === null) return `${wanted} is out of reach for this swing.`;
  const left = stop.more_s - age_s;
  return left > 0 ? `About ${seconds(left)} s more for ${wanted}.` : "";
}

// A chart of the report, whose label names the unit that the analysis chose; without a motion there is none.
function show_chart(shown, chart) {
  shown.box.closest("section").hidden = !chart;
  if (!chart) return;
  const label = shown.panel.label;
  shown.show(chart.panels[0]);
  if (shown.panel.label !== label) shown.build();
  name_series(shown);
}

// The names of a panel's series under it.
function name_series(chart, series = chart.panel.series) {
  const names = legendsOf({ panels: [{ ...chart.panel, series }] }, isDark(chart.box))[0].map((entry) => {
    const found = item(entry.label), key = element("canvas", "", { width: 24, height: 12 });
    drawKey(key.getContext("2d"), entry, 0, 6, 1);
    found.prepend(key, " ");
    return found;
  });
  $(`${chart.box.id}-names`).replaceChildren(...names);
}

matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { if (amplitude) [amplitude, spectrum].forEach((chart) => name_series(chart)), named = ""; dirty = true; });

// What the position shows is named anew only when it changes, not in each frame.
function name_position(series) {
  const now = series.map(({ label, line }) => `${label} ${line}`).join();
  if (now !== named) name_series(position, series);
  named = now;
}

// The fits are thin lines below the samples, with two points per pixel; uPlot has no series of them.
const LEAST_SWING_PX = 6, FIT = { label: "fit", role: "law", line: true }, REGION = { label: "fit of the selection", role: "other", line: true };
function draw_fits(plot) {
  const { min, max } = plot.scales.x;
  if (motion && motion.fit) draw_fit(plot, motion.fit, Math.max(min, motion.fit.start, motion.fit.moment - 20), Math.min(max, end_time()), FIT);
  if (region && region.fit && selection) draw_fit(plot, region.fit, Math.max(min, region.fit.start, region.fit.moment - 20), Math.min(max, selection.to), REGION);
}

function draw_fit(plot, fit, from, to, { role }) {
  const { ctx } = plot, step = (plot.posToVal(1, "x") - plot.posToVal(0, "x")) / 2;
  if (!(to > from) || (2 * Math.PI) / fit.omega < 2 * LEAST_SWING_PX * step) return;
  ctx.save();
  ctx.beginPath();
  for (let t = from; t <= to; t += step) {
    const y = fit.rest + fit.amplitude * decay(fit.decay, t - fit.moment) * Math.cos(fit.omega * (t - fit.moment) + fit.phase);
    ctx.lineTo(plot.valToPos(t, "x", true), plot.valToPos((y - zero()) * scale(), "y", true));
  }
  ctx.strokeStyle = lookOf(role, 0, position.dark).colour;
  ctx.lineWidth = devicePixelRatio;
  ctx.stroke();
  ctx.restore();
}

function end_time() { return play_time !== null ? play_time : last_time(); }

function in_view() {
  const all = samples[0], span = WINDOWS[window_index], end = end_time();
  return [span === Infinity ? (all.count ? all.t[0] : 0) : end - span, end];
}

// The amplitude of the damping law, ``after`` seconds from the last window, divided by its amplitude at that window.
function decay({ from, step, value }, after) {
  const at = Math.min(Math.max((after - from) / step, 0), value.length - 1), low = Math.min(Math.floor(at), value.length - 2);
  return value[low] + (at - low) * (value[low + 1] - value[low]);
}

function step_play() {
  const at = performance.now(), all = samples[0], last = all.t[all.count - 1];
  play_time += ((at - play_moment) / 1e3) * Number($("speed").value);
  play_moment = at;
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
  const level = motion && motion.rest_m !== undefined ? shown(motion.rest_m) : null, ends = t.length ? [t[0], t[t.length - 1]] : [];
  const marks = ((state && state.marks) || []).filter(([at]) => ends.length && at >= ends[0] && at <= ends[1]);
  // Samples that are far enough apart are drawn as dots, so that the fit below is visible; denser ones as a line.
  const dense = t.length > 0.7 * $("position").clientWidth, { min, max } = position.plot.scales.y;
  position.show({ ...position.panel, range: fixed && min != null ? [min, max] : around(y.map(shown)), series: [
    { label: "rest", role: "rest", line: true, x: level === null ? [] : ends, y: ends.map(() => level) },
    { label: "samples", role: "data", line: dense, x: t, y: y.map(shown) },
    { label: "marks", role: "mark", x: marks.map(([at]) => at), y: marks.map(() => null), why: marks.map(([, text]) => text) },
  ] });
  const [rest, measured, marked] = position.panel.series;
  name_position([measured, motion && motion.fit && FIT, region && region.fit && selection && REGION, level !== null && rest, marks.length && marked].filter(Boolean));
  const omega = motion && motion.omega, swing = omega ? (2 * Math.PI) / omega : 1;
  const orbit = all.orbit(end - 3 * swing, end, Math.max(1, Math.round((swing / 40) * run.rate_hz)));
  const x = orbit.map(([p]) => shown(p)), v = orbit.map(([, v_m]) => v_m * k), fastest = Math.max(...v.map(Math.abs)), middle = (Math.max(...x) + Math.min(...x)) / 2;
  // Velocity divided by angular frequency has the unit of position; with equal scales for both, a swing is a circle.
  if (x.length) phase.show({ ...phase.panel, range: [-1.1 * fastest, 1.1 * fastest], ...(omega && { span: [middle - fastest / omega, middle + fastest / omega] }), series: [{ label: "velocity", role: "data", x, y: v }] });
}
