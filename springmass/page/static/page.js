"use strict";
// The page shows what the recording's log has taken, and what the recorder has acknowledged: nothing before.
const $ = (id) => document.getElementById(id);
let run = null, samples = [], state = null, motion = null, socket = null, wait_ms = 250, dirty = true, came = [];

const scale = () => (run.unit === "m" ? 1e3 : 1);
const unit = () => (run.unit === "m" ? "mm" : run.unit);
const bench = () => (state && state.bench) || { phase: "waiting" };
// Where the rest position was measured, positions are counted from there.
const zero = () => bench().rest_m || 0;

function say(text) { $("said").textContent = text; }
function trouble(text) { $("trouble").textContent = text; $("trouble").hidden = !text; }
function tell(text, bad) { $("told").textContent = text; $("told").className = bad ? "bad" : ""; }
function ask_server(message) { if (socket && socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify(message)); }

function connect() {
  socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/v1/run`);
  socket.binaryType = "arraybuffer";
  socket.onopen = () => { wait_ms = 250; trouble(""); };
  socket.onmessage = (event) => (typeof event.data === "string" ? told(JSON.parse(event.data)) : took(event.data));
  socket.onclose = lost;
}

function lost() {
  if (bench().phase === "over" || bench().phase === "ended" || bench().phase === "built") {
    trouble(`The recording has ended and its page with it; what is shown stays. springmass page ${run.name} shows the run again.`);
    chip("stage", PHASES.over);
    $("stage").className = "chip over";
    return;
  }
  const network = run && run.role === "viewer" ? " Is this device still in the same network, and does that let its members reach one another? Guest networks often do not." : "";
  trouble(`The page has lost its server; the recording is not part of it and goes on. Trying again ...${network}`);
  setTimeout(connect, wait_ms);
  wait_ms = Math.min(2 * wait_ms, 5000);
}

function told(message) {
  if (message.type === "hello") hello(message);
  else if (message.type === "state") { state = message; show_state(); }
  else if (message.type === "motion") { motion = message; show_motion(); }
  else if (message.type === "region") show_region(message);
  dirty = true;
}

function hello(message) {
  if (message.version !== 1) { trouble(`This page speaks version 1 of the messages, its server ${message.version}: load it again.`); return; }
  // The same run sends all samples again from the first; another run begins anew.
  samples = message.sensors.map(() => new Samples());
  const other = !run || run.session !== message.session;
  run = message;
  if (other) { motion = null; begin_anew(); }
  document.title = `${run.title || run.name} · springmass`;
  $("name").textContent = run.title ? `${run.title} (${run.name})` : run.name;
  $("source").textContent = run.simulated ? `SIMULATED${run.source === "REPLAY" ? " · REPLAY" : ""}` : run.source;
  $("source").className = `chip ${run.simulated ? "SIMULATED" : run.source}`;
  $("role").hidden = run.role !== "viewer";
  $("play").hidden = $("scrub").hidden = run.source !== "REPLAY";
  keep_awake();
}

function took(buffer) {
  const [kind, sensor, first, count] = new Uint32Array(buffer, 0, 4);
  if (kind !== 1) return;
  samples[sensor].take(first, new Float64Array(buffer, 16, count), new Float64Array(buffer, 16 + 8 * count, count));
  came.push([performance.now(), count]);
  dirty = true;
}

const PHASES = { ready: "READY, not recording", still: "keep it still ...", armed: "ARMED", recording: "RECORDING", ended: "building the run file", built: "saved", over: "ended" };

function chip(id, text) { $(id).hidden = !text; $(id).textContent = text; }

function show_state() {
  const now = bench(), moment = performance.now();
  came = came.filter(([at]) => moment - at < 2000);
  const rate = came.reduce((sum, [, count]) => sum + count, 0) / 2, live = run.source !== "REPLAY" && !state.ended;
  chip("stage", now.phase === "armed" ? `ARMED: ${(now.threshold_m * 1e3).toFixed(0)} mm, ${now.keep_s} s kept from before` : PHASES[now.phase] || "");
  $("stage").className = `chip ${now.phase}`;
  chip("clock", live ? `${rate.toFixed(0)} Hz, ${CLOCKS[run.clock]}` : CLOCKS[run.clock]);
  chip("counts", `${state.samples[0].toLocaleString("en")} samples, ${state.missing} missing`);
  chip("calibration", calibration(now));
  chip("disk", state.disk_free_bytes === null || !live ? "" : `${(state.disk_free_bytes / 1e9).toFixed(1)} GB free`);
  if (state.error) trouble(state.error);
  const failed = now.failed || "";
  tell(failed || now.said || after(now), Boolean(failed));
  const items = [...state.marks.map(([t, text]) => `${t.toFixed(2)} s: ${text}`), ...state.notes, ...(now.noted || []).map((text) => `note: ${text}`)];
  $("marks").replaceChildren(...items.map((text) => item(text)));
  show_actions();
  if (now.rest_m !== shown_zero) begin_anew();
}

const CLOCKS = { device: "sensor's clock", host: "this computer's clock", nominal: "nominal clock" };

function calibration(now) {
  const rest = now.rest_m === undefined ? "" : `zero ${(now.rest_m * 1e3).toFixed(1)} mm, noise ${(now.noise_m * 1e3).toFixed(2)} mm`;
  return [run.calibration, rest].filter(Boolean).join("; ");
}

function after(now) {
  if (now.discarded) return `Put aside as ${now.discarded}; nothing was deleted.`;
  if (now.report === "making") return "The report is being made ...";
  if (now.report === "ready") return "The report is made.";
  if (now.phase === "built") return `${run.name} is saved. O opens its report.`;
  return "";
}

function item(text, kind) {
  const found = document.createElement("li");
  found.textContent = text;
  if (kind) found.className = kind;
  return found;
}

// Phones go dark otherwise; browsers allow it under https and on this computer alone.
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
