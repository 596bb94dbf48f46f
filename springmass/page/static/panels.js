"use strict";
// Numbers with their age, and the four charts.
const WINDOWS = [5, 10, 30, 60, 300, Infinity];
const LABELS = { period: "period", amplitude_now: "amplitude now", spring_constant: "spring constant k", damping_rate: "damping rate", noise: "noise", offset: "rest position", quality_factor: "quality factor", sample_rate: "sampling rate", drop_outs: "drop-outs" };
// Estimates that depend on the damping law, which may be stated.
const OF_LAW = new Set(["damping_rate", "quality_factor"]);
const KINDS = { voltage: "voltage", angle: "angle", acceleration: "acceleration", force: "force", length: "position" };
const FRESH_S = 2;
let position, amplitude, phase, spectrum, shown_zero, phase_span = null, peaks = [];
let frozen = false, fixed = false, window_index = 1, playing = false, play_time = null, play_moment = 0;

function begin_anew() {
  shown_zero = bench().rest_m;
  play_time = null;
  if (run.source === "REPLAY") window_index = WINDOWS.length - 1, show_window();
  const what = `${shown_zero === undefined ? KINDS[run.quantity] || run.quantity : "displacement"} / ${unit()}`;
  if (position) for (const chart of [position, amplitude, phase, spectrum]) chart.destroy();
  // The page's own cursor stays at its sample; uPlot's cursor stays at its place on the screen, so it is turned off.
  const select = { cursor: { x: false, y: false, points: { show: false }, drag: { x: true, y: false, setScale: false } }, hooks: { setSelect: [selected], drawAxes: [draw_selection, draw_fits], draw: [draw_marks, draw_cursors] } };
  const still = { cursor: { show: false } };
  position = new Chart("position", [samples_series(), line("fit", "fit", null, 1), line("rest", "rest", [6, 4], 1)], ["time / s", what], select);
  amplitude = new Chart("amplitude", [points("amplitude")], ["time / s", `amplitude / ${unit()}`], still);
  phase = new Chart("phase", [points("velocity", 3)], [what, `velocity / (${unit()}/s)`], { ...still, scales: { x: { time: false, range: (_, min, max) => phase_range("x", min, max) }, y: { range: (_, min, max) => phase_range("y", min, max) } } });
  spectrum = new Chart("spectrum", [line("amplitude", "data", null, 1)], ["frequency / Hz", `amplitude / ${unit()}`], { ...still, scales: { x: { time: false }, y: { distr: 3 } }, hooks: { draw: [draw_peaks] } }, true);
  forget_selection();
  if (motion) show_motion();
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

// Time advances between messages during a recording, but not after it; a replay is at the moment that is played.
const is_over = () => run.source === "REPLAY" || state.ended;
const is_played = () => run.source === "REPLAY" && play_time !== null && play_time < last_time() - 1e-9;
function last_time() { const all = samples[0]; return all && all.count ? all.t[all.count - 1] : 0; }
function now_s() {
  if (is_played()) return play_time;
  return last_time() + (!state || is_over() ? 0 : (performance.now() - came_at) / 1e3);
}
// The message whose numbers are shown: that about the moment that is played, or else that about all samples.
const shown_message = () => (is_played() && moment ? moment : motion);

function show_motion() {
  const message = shown_message();
  if (!message) return;
  $("why").textContent = message.why || "";
  const fresher = now && !is_over() && now.t_s > (message.t_s || 0) ? now.estimates : {};
  const estimates = { ...message.estimates, ...(message.estimates ? fresher : {}) };
  $("estimates").replaceChildren(...Object.keys(LABELS).filter((name) => estimates[name]).map((name) => {
    const group = pair(LABELS[name] + (OF_LAW.has(name) && message.stated_law ? `, law ${message.stated_law}` : ""), short(estimates[name])), detail = group.lastChild, age = document.createElement("span");
    detail.title = estimates[name].text;
    group.dataset.name = name;
    group.dataset.t = fresher[name] ? now.t_s : message.t_s;
    age.className = "age";
    detail.append(age);
    return group;
  }));
  show_ages();
  $("findings").replaceChildren(...(message.findings || []).map((f) => item(f.advice ? `${f.message.replace(/\.$/, "")}. ${f.advice}` : f.message, f.severity)));
  if (!(message.findings || []).length) $("findings").replaceChildren(item(message.count || message.type === "moment" ? "No warnings." : "No analysis yet."));
  if (message.amplitude) {
    const laws = message.laws, times = message.amplitude.t;
    const series = [points("amplitude"), ...laws.map((law, i) => line(law.name === message.stated_law ? `${law.name} (stated)` : law.name, law.name === message.law ? "fit" : `other-${(i % 4) + 1}`, law.name === message.law ? null : DASHES[i % 4]))];
    if (series.map((s) => s.label).join() !== amplitude.series.map((s) => s.label).join()) amplitude.build(series);
    const k = scale();
    const columns = [[times, message.amplitude.value.map((x) => x * k)], ...laws.map((law) => [law.t, law.value.map((x) => x * k)])];
    amplitude.show(uPlot.join(columns));
  }
  if (message.spectrum && message.spectrum.f.length) show_spectrum(message.spectrum);
  if (selection) show_region_fits();
}

// Numbers older than two seconds are grey and show their age; this is updated four times a second.
function show_ages() {
  const message = shown_message(), at = run && state && message ? now_s() : null;
  if (at === null) return;
  for (const group of $("estimates").children) {
    const age = Math.abs(at - Number(group.dataset.t)), old = age > FRESH_S;
    group.classList.toggle("stale", old);
    group.querySelector(".age").textContent = old ? (is_played() ? `at ${Number(group.dataset.t).toFixed(1)} s` : `${age.toFixed(0)} s old`) : "";
  }
  const whole = message.accuracy === "standard";
  $("tier").textContent = !message.accuracy ? "" : whole ? "Standard accuracy, whole run." : is_played() ? `Fast accuracy, samples up to ${message.t_s === null ? "" : message.t_s.toFixed(1)} s.` : "Fast accuracy while the run goes on; the report uses standard accuracy.";
  const forecast = message.stop && !is_over() && bench().phase === "recording" && message.t_s !== undefined;
  $("stopping").textContent = forecast ? stopping(message.stop, at - message.t_s) : "";
  $("stopping").classList.toggle("stale", forecast && at - message.t_s > FRESH_S);
  $("why").classList.toggle("stale", !is_over() && at - message.t_s > FRESH_S);
}
setInterval(() => { if (run && state) { show_ages(); show_rate(); } }, 250);

const seconds = (s) => (s < 10 ? s.toFixed(1) : s.toFixed(0));

function stopping(stop, age_s) {
  const wanted = `u(T) = ${(stop.wanted_u_s * 1e6).toFixed(0)} µs`;
  const interval = `If you stop now: T between ${stop.low.toFixed(6)} and ${stop.high.toFixed(6)} s (${(100 * stop.covers).toFixed(0)} %).`;
  if (stop.more_s === 0) return `${interval} ${wanted} is reached.`;
  if (stop.u_clock_s >= stop.wanted_u_s) return `${interval} ${wanted} is out of reach: the uncertainty of the sensor's clock alone is ${(stop.u_clock_s * 1e6).toFixed(0)} µs.`;
  if (stop.more_s === null) return `${interval} ${wanted} is out of reach for this swing.`;
  const left = stop.more_s - age_s;
  return left > 0 ? `${interval} About ${seconds(left)} s more for ${wanted}.` : interval;
}

// The highest peaks are at the low end of the spectrum; frequencies far above them are cut off.
function show_spectrum({ f, value, peaks: found }) {
  peaks = found || [];
  const highest = Math.max(...peaks.map((peak) => peak.f), 0), end = Math.max(10, 4 * highest);
  const stop = f.findIndex((x) => x > end), upto = stop < 0 ? f.length : stop;
  spectrum.show([f.slice(1, upto), value.slice(1, upto).map((x) => x * scale())]);
}

function draw_peaks(plot) {
  const { ctx, bbox } = plot, taken = [];
  ctx.save();
  ctx.fillStyle = COLOURS.ink;
  ctx.textAlign = "left";
  ctx.font = `${11 * devicePixelRatio}px system-ui`;
  for (const { f, value, step } of [...peaks].sort((a, b) => b.value - a.value)) {
    const text = `${f.toFixed(Math.max(0, Math.ceil(-Math.log10(step))))} Hz`, wide = ctx.measureText(text).width, high = 13 * devicePixelRatio;
    const x = Math.min(plot.valToPos(f, "x", true) + 4, bbox.left + bbox.width - wide), y = Math.max(plot.valToPos(value * scale(), "y", true), bbox.top + high);
    if (taken.some((box) => x < box.x + box.wide && box.x < x + wide && Math.abs(y - box.y) < high)) continue;
    taken.push({ x, y, wide });
    ctx.fillText(text, x, y);
  }
  ctx.restore();
}

// Velocity divided by angular frequency has the unit of position; with equal scales for both, a swing is drawn as a
// circle.
function phase_range(axis, min, max) {
  if (!phase_span || !phase || !(phase_span.reach > 0)) return min === null ? [-1, 1] : uPlot.rangeNum(min, max, 0.1, true);
  const { width, height } = phase.plot.bbox, { middle, reach, omega } = phase_span, wider = Math.max(1, width / height), higher = Math.max(1, height / width);
  return axis === "x" ? [middle - reach * wider, middle + reach * wider] : [-reach * omega * higher, reach * omega * higher];
}

// Draw each mark as a dashed line with its text.
function draw_marks(plot) {
  if (!state) return;
  const { ctx, bbox } = plot, { min, max } = plot.scales.x;
  ctx.save();
  ctx.strokeStyle = ctx.fillStyle = COLOURS["other-2"];
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

// The fits are thin lines below the samples, with two points per pixel.
const LEAST_SWING_PX = 6;
function draw_fits(plot) {
  const message = shown_message(), { min, max } = plot.scales.x;
  if (message && message.fit) draw_fit(plot, message.fit, Math.max(min, message.fit.moment - 20), Math.min(max, end_time()), "fit");
  if (region && region.fit && selection) draw_fit(plot, region.fit, Math.max(min, selection.from, region.fit.moment - 20), Math.min(max, selection.to), "other-1");
}

function draw_fit(plot, fit, from, to, name) {
  const { ctx } = plot, step = (plot.posToVal(1, "x") - plot.posToVal(0, "x")) / 2;
  if (!(to > from) || (2 * Math.PI) / fit.omega < 2 * LEAST_SWING_PX * step) return;
  ctx.save();
  ctx.beginPath();
  for (let t = from; t <= to; t += step) {
    const y = fit.rest + fit.amplitude * decay(fit.decay, t - fit.moment) * Math.cos(fit.omega * (t - fit.moment) + fit.phase);
    ctx.lineTo(plot.valToPos(t, "x", true), plot.valToPos((y - zero()) * scale(), "y", true));
  }
  ctx.strokeStyle = COLOURS[name];
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
    if ($("loop").checked) play_time = all.t[0]; else { play_time = last; play(); show_motion(); }
  }
  $("time").value = (play_time - all.t[0]) / (last - all.t[0]);
}

// Request the numbers of the moment that is played, after the last answer has arrived and if the moment has changed.
let moment_asked = null;
function ask_moment() {
  if (!is_played()) { if (moment) { moment = null; show_motion(); } return; }
  if (moment_asked !== null || (moment && Math.abs(moment.to - play_time) < 0.25)) return;
  moment_asked = play_time;
  ask_server({ type: "moment", to: play_time });
}

function draw() {
  requestAnimationFrame(draw);
  if (!run || !samples[0] || !position || document.hidden) return;
  if (playing) step_play();
  if (run.source === "REPLAY") ask_moment();
  if (frozen || !(dirty || playing)) return;
  dirty = false;
  const [from, end] = in_view(), all = samples[0], message = shown_message();
  const [t, y] = all.between(from, end, Math.max(200, $("position").clientWidth));
  const k = scale(), z = zero(), shown = (v) => (v === null ? null : (v - z) * k);
  const rest = t.map(() => (message && message.rest_m !== undefined ? shown(message.rest_m) : null));
  const keep = fixed ? { ...position.plot.scales.y } : null;
  position.show([t, y.map(shown), t.map(() => null), rest]);
  if (keep && keep.min != null) position.plot.setScale("y", { min: keep.min, max: keep.max });
  const omega = message && message.omega, swing = omega ? (2 * Math.PI) / omega : 1;
  const reach = Math.max(1, Math.round((swing / 40) * run.rate_hz));
  const orbit = all.orbit(end - 3 * swing, end, reach).sort((a, b) => a[0] - b[0]);
  if (omega && orbit.length) {
    const low = shown(orbit[0][0]), high = shown(orbit[orbit.length - 1][0]), fastest = Math.max(...orbit.map(([, v]) => Math.abs(v))) * k;
    phase_span = { middle: (low + high) / 2, reach: 1.1 * Math.max((high - low) / 2, fastest / omega), omega };
  } else phase_span = null;
  phase.show([orbit.map(([p]) => shown(p)), orbit.map(([, v]) => v * k)]);
}
