"use strict";
// The page shows what the recording's log has taken, and nothing before.
const $ = (id) => document.getElementById(id);
const WINDOWS = [5, 10, 30, 60, 300, Infinity];
const LABELS = { period: "period", amplitude_now: "amplitude now", spring_constant: "spring constant k", damping_rate: "damping rate", noise: "noise", offset: "rest position", quality_factor: "quality factor" };
const KINDS = { voltage: "voltage", angle: "angle", acceleration: "acceleration", force: "force", length: "position" };

let run = null, samples = [], state = null, motion = null, socket = null, wait_ms = 250;
let frozen = false, fixed = false, window_index = 1, playing = false, play_time = null, play_moment = 0, rate = 0, came = [];

const scale = () => (run.unit === "m" ? 1e3 : 1);
const unit = () => (run.unit === "m" ? "mm" : run.unit);

let position, amplitude, phase, spectrum;
function build_charts() {
  const what = `${KINDS[run.quantity] || run.quantity} / ${unit()}`;
  for (const id of ["position", "amplitude", "phase", "spectrum"]) $(id).replaceChildren();
  const select = { cursor: { drag: { x: true, y: false, setScale: false } }, hooks: { setSelect: [selected], setCursor: [pointed], draw: [draw_marks] } };
  position = new Chart("position", [{ label: "samples", stroke: COLOURS.data, width: 1, points: { show: false } }, line("fit", COLOURS.fit), line("rest", COLOURS.rest, [6, 4], 1)], ["time / s", what], select);
  amplitude = new Chart("amplitude", [points("amplitude")], ["time / s", `amplitude / ${unit()}`]);
  phase = new Chart("phase", [{ label: "velocity", stroke: COLOURS.data, points: { show: true, size: 3, fill: COLOURS.data }, paths: () => null }], [what, `velocity / (${unit()}/s)`]);
  spectrum = new Chart("spectrum", [line("amplitude", COLOURS.data, null, 1)], ["frequency / Hz", `amplitude / ${unit()}`], { scales: { x: { time: false }, y: { distr: 3 } } });
}

function say(text) { $("said").textContent = text; }
function trouble(text) { $("trouble").textContent = text; $("trouble").hidden = !text; }

function connect() {
  socket = new WebSocket(`ws://${location.host}/v1/run`);
  socket.binaryType = "arraybuffer";
  socket.onopen = () => { wait_ms = 250; trouble(""); };
  socket.onmessage = (event) => (typeof event.data === "string" ? told(JSON.parse(event.data)) : took(event.data));
  socket.onclose = () => {
    if (state && state.ended && run.controls) {
      trouble("The recording has ended and its page with it; what is shown stays. springmass page RUN.h5 shows the run again.");
      return;
    }
    trouble("The page has lost its server; the recording is not part of it and goes on. Trying again ...");
    setTimeout(connect, wait_ms);
    wait_ms = Math.min(2 * wait_ms, 5000);
  };
}

function told(message) {
  if (message.type === "hello") hello(message);
  else if (message.type === "state") { state = message; show_state(); }
  else if (message.type === "motion") { motion = message; show_motion(); }
  else if (message.type === "region") show_region(message);
}

function hello(message) {
  if (message.version !== 1) { trouble(`This page speaks version 1 of the messages, its server ${message.version}: load it again.`); return; }
  // The same run sends all samples again from the first; another run begins anew.
  samples = message.sensors.map(() => new Samples());
  const other = !run || run.session !== message.session;
  run = message;
  if (other) { motion = null; play_time = null; build_charts(); }
  document.title = `${run.title || run.name} · springmass`;
  $("name").textContent = run.title ? `${run.title} (${run.name})` : run.name;
  $("source").textContent = run.simulated ? `SIMULATED${run.source === "REPLAY" ? " · REPLAY" : ""}` : run.source;
  $("source").className = `chip ${run.simulated ? "SIMULATED" : run.source}`;
  const replay = !run.controls;
  $("mark").hidden = $("stop").hidden = replay;
  $("play").hidden = $("scrub").hidden = !(run.source === "REPLAY");
  if (replay && run.source === "REPLAY") window_index = WINDOWS.length - 1, show_window();
}

function took(buffer) {
  const [kind, sensor, first, count] = new Uint32Array(buffer, 0, 4);
  if (kind !== 1) return;
  samples[sensor].take(first, new Float64Array(buffer, 16, count), new Float64Array(buffer, 16 + 8 * count, count));
  came.push([performance.now(), count]);
}

function show_state() {
  const total = state.samples[0];
  $("counts").hidden = false;
  $("counts").textContent = `${total.toLocaleString("en")} samples, ${state.missing} missing`;
  $("ended").hidden = !state.ended || run.source === "REPLAY";
  if (state.error) trouble(state.error);
  const items = [...state.marks.map(([t, text]) => `${t.toFixed(2)} s: ${text}`), ...state.notes];
  $("marks").replaceChildren(...items.map((text) => item(text)));
}

function item(text, kind) {
  const found = document.createElement("li");
  found.textContent = text;
  if (kind) found.className = kind;
  return found;
}

// Value and uncertainty as people write them: two digits of the uncertainty in brackets.
function short(estimate) {
  let { value, u, unit: name } = estimate, factor = 1;
  const prefixes = { m: [1e3, "mm"], s: [1, "s"] };
  if (prefixes[name]) [factor, name] = prefixes[name];
  value *= factor;
  if (u === null || !(u > 0)) return `${Number(value.toPrecision(5))} ${name}`;
  u *= factor;
  let digits = 1 - Math.floor(Math.log10(u));
  if (Math.round(u * 10 ** digits) >= 100) digits -= 1;
  if (digits <= 0) return `${value.toFixed(0)}(${u.toFixed(0)}) ${name}`;
  if (digits > 7) return `${value.toExponential(3)} ± ${u.toExponential(1)} ${name}`;
  const bracket = digits === 1 && u >= 1 ? u.toFixed(1) : String(Math.round(u * 10 ** digits));
  return `${value.toFixed(digits)}(${bracket}) ${name}`;
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
  $("findings").replaceChildren(...(motion.findings || []).map((f) => item(f.message, f.severity)));
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

function stopping(stop) {
  const wanted = `u(T) = ${(stop.wanted_u_s * 1e6).toFixed(0)} µs`;
  const interval = `Whenever you stop, T lies in ${stop.low.toFixed(6)} to ${stop.high.toFixed(6)} s with ${(100 * stop.covers).toFixed(0)} %.`;
  if (stop.more_s === 0) return `${interval} ${wanted} is reached.`;
  if (stop.u_clock_s >= stop.wanted_u_s) return `${interval} ${wanted} is out of reach: the sensor's clock alone leaves ${(stop.u_clock_s * 1e6).toFixed(0)} µs.`;
  if (stop.more_s === null) return `${interval} ${wanted} is out of reach for this swing.`;
  return `${interval} About ${stop.more_s < 10 ? stop.more_s.toFixed(1) : stop.more_s.toFixed(0)} s more for ${wanted}.`;
}

function show_region(found) {
  $("region").hidden = false;
  $("region-title").textContent = `Region ${found.from.toFixed(2)} to ${found.to.toFixed(2)} s`;
  list($("region-estimates"), found.estimates || {});
  $("region-why").textContent = found.why || "";
  say($("region-title").textContent);
}

function selected(plot) {
  const { left, width } = plot.select;
  if (width < 8) return;
  const from = plot.posToVal(left, "x"), to = plot.posToVal(left + width, "x");
  socket.send(JSON.stringify({ type: "region", from, to }));
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
    ctx.fillText(text.slice(0, 30), x + 4, bbox.top + 12 * devicePixelRatio);
  }
  ctx.restore();
}

let pinned = null;
function pointed(plot) {
  const { idx } = plot.cursor;
  if (idx === null || idx === undefined || plot.data[1][idx] == null) { $("cursor").textContent = ""; return; }
  const t = plot.data[0][idx], y = plot.data[1][idx];
  let text = `${t.toFixed(3)} s, ${y.toFixed(3)} ${unit()}`;
  if (pinned) text += `; from the pin: ${(t - pinned[0]).toFixed(3)} s, ${(y - pinned[1]).toFixed(3)} ${unit()}, slope ${((y - pinned[1]) / (t - pinned[0])).toFixed(2)} ${unit()}/s`;
  $("cursor").textContent = text;
}
$("position").addEventListener("click", () => {
  const { idx } = position.plot.cursor;
  if (idx != null && position.plot.data[1][idx] != null) pinned = [position.plot.data[0][idx], position.plot.data[1][idx]];
});

function end_time() {
  const all = samples[0];
  if (!all || !all.count) return 0;
  if (play_time !== null) return play_time;
  return all.t[all.count - 1];
}

function fit_at(t) {
  const fit = motion && motion.fit;
  if (!fit || t < fit.moment - 20 || play_time !== null) return null;
  return fit.rest + fit.amplitude * Math.cos(fit.omega * (t - fit.moment) + fit.phase);
}

function draw() {
  requestAnimationFrame(draw);
  if (!run || !samples[0] || document.hidden) return;
  if (playing) {
    const now = performance.now(), all = samples[0];
    play_time += ((now - play_moment) / 1e3) * Number($("speed").value);
    play_moment = now;
    const last = all.t[all.count - 1];
    if (play_time > last) {
      if ($("loop").checked) play_time = all.t[0]; else { play_time = last; play(); }
    }
    $("time").value = (play_time - all.t[0]) / (last - all.t[0]);
  }
  const now = performance.now();
  came = came.filter(([moment]) => now - moment < 2000);
  rate = came.reduce((sum, [, count]) => sum + count, 0) / 2;
  if (run.controls) { $("clock").hidden = false; $("clock").textContent = `${rate.toFixed(0)} Hz`; }
  if (frozen) return;
  const end = end_time(), span = WINDOWS[window_index], all = samples[0];
  const from = span === Infinity ? (all.count ? all.t[0] : 0) : end - span;
  const [t, y] = all.between(from, end, Math.max(200, $("position").clientWidth));
  const k = scale(), close = t.length && t[t.length - 1] - t[0] < 40;
  const fit = close ? t.map((x) => { const f = fit_at(x); return f === null ? null : f * k; }) : t.map(() => null);
  const rest = motion && motion.rest_m !== undefined ? t.map(() => motion.rest_m * k) : t.map(() => null);
  const keep = fixed ? { ...position.plot.scales.y } : null;
  position.show([t, y.map((v) => (v === null ? null : v * k)), fit, rest]);
  if (keep && keep.min != null) position.plot.setScale("y", { min: keep.min, max: keep.max });
  const swing = motion && motion.omega ? (2 * Math.PI) / motion.omega : 1;
  const reach = Math.max(1, Math.round((swing / 40) * run.rate_hz));
  const orbit = all.orbit(end - 3 * swing, end, reach).sort((a, b) => a[0] - b[0]);
  phase.show([orbit.map(([p]) => p * k), orbit.map(([, v]) => v * k)]);
}

function press(button, on) { $(button).setAttribute("aria-pressed", String(on)); }
function label(button, text) { $(button).firstChild.textContent = `${text} `; }
function show_window() { const s = WINDOWS[window_index]; label("window", s === Infinity ? "all" : `${s} s`); }
function play() {
  playing = !playing;
  const all = samples[0];
  if (playing) {
    play_moment = performance.now();
    if (play_time === null || play_time >= all.t[all.count - 1]) play_time = all.t[0];
    if (WINDOWS[window_index] === Infinity) window_index = 1, show_window();
  }
  label("play", playing ? "Pause" : "Play");
}

const ACTIONS = {
  mark() { const text = prompt("Mark", "mark"); if (text !== null) socket.send(JSON.stringify({ type: "mark", text: text || "mark" })); },
  stop() { if (confirm("Stop the recording? Its run file is built then.")) socket.send(JSON.stringify({ type: "stop" })); },
  play,
  freeze() { frozen = !frozen; press("freeze", frozen); },
  axes() { fixed = !fixed; press("axes", fixed); },
  window() { window_index = (window_index + 1) % WINDOWS.length; show_window(); },
  csv() {
    const span = WINDOWS[window_index], end = end_time(), all = samples[0];
    const from = span === Infinity ? -Infinity : end - span;
    let text = `time_s,${run.quantity === "length" ? "distance_m" : `${run.quantity}_${run.unit}`}\n`;
    for (let i = all.at(from); i < all.count && all.t[i] <= end; i++) text += `${all.t[i]},${Number.isNaN(all.y[i]) ? "" : all.y[i]}\n`;
    const link = document.createElement("a");
    link.href = URL.createObjectURL(new Blob([text], { type: "text/csv" }));
    link.download = `${run.name.replace(/\.[^.]*$/, "")}-view.csv`;
    link.click();
    URL.revokeObjectURL(link.href);
    say("CSV of what is in view saved");
  },
  voice() {
    const e = motion && motion.estimates;
    const words = e ? `Period ${e.period.value.toFixed(3)} seconds` + (e.amplitude_now ? `, amplitude ${(e.amplitude_now.value * scale()).toFixed(1)} ${unit() === "mm" ? "millimetres" : unit()}` : "") : "No motion yet";
    say(words);
    if (window.speechSynthesis) { speechSynthesis.cancel(); speechSynthesis.speak(new SpeechSynthesisUtterance(words)); }
  },
};
for (const button of document.querySelectorAll("#actions button")) button.addEventListener("click", () => ACTIONS[button.id]());
document.addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey || /^(INPUT|SELECT)$/.test(event.target.tagName)) return;
  const button = [...document.querySelectorAll("#actions button")].find((b) => b.dataset.key === event.key.toLowerCase() && !b.hidden);
  if (button) { event.preventDefault(); ACTIONS[button.id](); }
});
$("time").addEventListener("input", () => {
  const all = samples[0];
  play_time = all.t[0] + Number($("time").value) * (all.t[all.count - 1] - all.t[0]);
  if (WINDOWS[window_index] === Infinity) window_index = 1, show_window();
});
connect();
requestAnimationFrame(draw);
