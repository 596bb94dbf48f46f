"use strict";
// The page shows only samples in the recording's log, and only states that the recorder has acknowledged.
const $ = (id) => document.getElementById(id);
let run = null, samples = [], state = null, socket = null, wait_ms = 250, dirty = true, came_at = 0;
let motion = null;

const scale = () => (run.unit === "m" ? 1e3 : 1);
const unit = () => (run.unit === "m" ? "mm" : run.unit);
const bench = () => (state && state.bench) || { phase: "waiting" };
// If the rest position was measured, positions are relative to it.
const zero = () => bench().rest_m || 0;

function say(text) { $("said").textContent = text; }
function trouble(text) { $("trouble").textContent = text; $("trouble").hidden = !text; }
function show_status(text, bad) { $("told").textContent = text; $("told").className = bad ? "bad" : ""; }
function ask_server(message) { if (socket && socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify(message)); }

function connect() {
  socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/v2/run`);
  socket.binaryType = "arraybuffer";
  socket.onopen = () => { wait_ms = 250; trouble(""); };
  socket.onmessage = (event) => (typeof event.data === "string" ? receive(JSON.parse(event.data)) : receive_samples(event.data));
  socket.onclose = lost;
}

function lost() {
  if (bench().phase === "over" || bench().phase === "ended" || bench().phase === "built") {
    trouble(`The recording has ended and the page was closed. To show the run again: springmass page ${run.name}`);
    chip("stage", PHASES.over);
    $("stage").className = "chip over";
    return;
  }
  const network = run && run.role === "viewer" ? " Is this device still in the same network? Guest networks often separate their members." : "";
  trouble(`The connection to the page's server is lost; a recording continues. Reconnecting ... If the page has ended, the terminal says how to open it again.${network}`);
  setTimeout(connect, wait_ms);
  wait_ms = Math.min(2 * wait_ms, 5000);
}

function receive(message) {
  if (message.type === "hello") hello(message);
  else if (message.type === "state") { state = message; show_state(); }
  else if (message.type === "motion") { receive_motion(message); show_motion(); }
  else if (message.type === "region") show_region(message);
  dirty = true;
}

function receive_motion(message) {
  Object.values(message.charts || {}).forEach(decoded);
  // A message of the same analysis has a newer amplitude and no charts, because these are the same.
  if (motion && motion.count === message.count && !message.charts) message.charts = motion.charts;
  motion = message;
}

function hello(message) {
  if (message.version !== 2) { trouble(`This page reads version 2 of the messages and its server sends version ${message.version}; reload the page.`); return; }
  // After a reconnection, all samples are sent again from the first; only another run resets the page.
  samples = message.sensors.map(() => new Samples());
  const other = !run || run.session !== message.session;
  run = message;
  came_at = performance.now();
  if (other) { motion = null; begin_anew(); }
  document.title = `${run.title || run.name} · springmass`;
  $("name").textContent = run.title ? `${run.title} (${run.name})` : run.name;
  $("source").textContent = run.simulated ? `SIMULATED${run.source === "REPLAY" ? " · REPLAY" : ""}` : run.source;
  $("source").className = `chip ${run.simulated ? "SIMULATED" : run.source}`;
  $("role").hidden = run.role !== "viewer";
  $("play").hidden = $("scrub").hidden = run.source !== "REPLAY";
  keep_awake();
}

function receive_samples(buffer) {
  const [kind, sensor, first, count] = new Uint32Array(buffer, 0, 4);
  if (kind !== 1) return;
  samples[sensor].take(first, new Float64Array(buffer, 16, count), new Float64Array(buffer, 16 + 8 * count, count));
  came_at = performance.now();
  dirty = true;
}

const PHASES = { ready: "READY, not recording", still: "keep it still ...", armed: "ARMED", recording: "RECORDING", ended: "saving the run ...", built: "saved", over: "ended" };

function chip(id, text) { $(id).hidden = !text; $(id).textContent = text; }

function show_state() {
  const at = bench(), live = !is_over();
  chip("stage", at.phase === "armed" ? `ARMED: ${(at.threshold_m * 1e3).toFixed(0)} mm, ${at.keep_s} s kept` : PHASES[at.phase] || "");
  $("stage").className = `chip ${at.phase}`;
  show_rate();
  chip("counts", `${state.samples[0].toLocaleString("en")} samples, ${state.missing} missing`);
  chip("calibration", calibration(at));
  chip("disk", state.disk_free_bytes === null || !live ? "" : `${(state.disk_free_bytes / 1e9).toFixed(1)} GB free`);
  if (state.error) trouble(state.error);
  const failed = (performance.now() < refused_until && refused) || at.failed || "";
  show_status(failed || at.said || after(at), Boolean(failed));
  const items = [...state.marks.map(([t, text]) => `${t.toFixed(2)} s: ${text}`), ...state.notes, ...(at.noted || []).map((text) => `Note: ${text}`)];
  $("marks").replaceChildren(...(items.length ? items : ["No marks."]).map((text) => item(text)));
  show_actions();
  if (at.rest_m !== shown_zero) begin_anew();
}

// The rate is calculated from the samples' own times over the last two seconds, so it is correct even if many samples
// arrive at once after a reload.
function rate_hz() {
  const all = samples[0];
  if (!all || all.count < 3) return null;
  const last = all.count - 1, first = all.at(all.t[last] - 2), span = all.t[last] - all.t[first];
  return span >= 1 ? (last - first) / span : null;
}

function show_rate() {
  const live = !is_over(), silent = (performance.now() - came_at) / 1e3, rate = rate_hz();
  const measured = silent > 1.5 ? `no samples for ${silent.toFixed(0)} s` : rate === null ? "" : `${rate.toFixed(0)} Hz`;
  chip("clock", [live ? measured : "", CLOCKS[run.clock]].filter(Boolean).join(", "));
}

const CLOCKS = { device: "sensor's clock", host: "this computer's clock", nominal: "nominal clock" };

function calibration(at) {
  const rest = at.rest_m === undefined ? "" : `zero ${(at.rest_m * 1e3).toFixed(1)} mm, noise ${(at.noise_m * 1e3).toFixed(2)} mm`;
  return [run.calibration, rest].filter(Boolean).join("; ");
}

function after(at) {
  if (at.discarded) return `The run is now ${at.discarded}; nothing was deleted.`;
  if (at.report === "making") return "The report is being made ...";
  if (at.report === "ready") return "The report is ready.";
  if (at.phase === "built") return `${run.name} is saved. O opens its report.`;
  return "";
}

const item = (text, kind = "") => element("li", text, { className: kind });

// Prevents a phone from turning its screen off; browsers allow this only over HTTPS and on this computer.
let awake = null;
async function keep_awake() {
  if (run.source === "REPLAY" || awake) return;
  $("sleep").hidden = Boolean(navigator.wakeLock) || run.role !== "viewer";
  if (!navigator.wakeLock) return;
  try {
    awake = await navigator.wakeLock.request("screen");
    awake.addEventListener("release", () => { awake = null; });
  } catch (error) { $("sleep").hidden = run.role !== "viewer"; }
}
document.addEventListener("visibilitychange", () => { dirty = true; if (!document.hidden && run) keep_awake(); });
