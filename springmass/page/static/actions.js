"use strict";
// One key and one button each. What the recorder is asked for shows once it has acknowledged it, in show_state.
function press(button, on) { $(button).setAttribute("aria-pressed", String(on)); }
function label(button, text) { $(button).firstChild.textContent = `${text} `; }
function show_window() { const s = WINDOWS[window_index]; label("window", s === Infinity ? "all" : `${s} s`); }

// What can be asked for in which state of the recorder; nothing of it by viewers.
const ALLOWED = { ready: ["zero", "ruler", "arm", "record", "close"], armed: ["arm", "record", "close"], recording: ["mark", "note", "stop"], built: ["report", "note", "discard", "close"], replay: ["report", "note"] };

function show_actions() {
  const allowed = run.role === "controller" ? ALLOWED[bench().phase] || [] : [];
  for (const id of ["zero", "ruler", "arm", "record", "mark", "note", "stop", "report", "discard", "close"]) $(id).hidden = !allowed.includes(id);
  if (bench().phase === "replay" && run.source !== "REPLAY") $("report").hidden = $("note").hidden = true;
  if (bench().discarded) $("discard").hidden = true;
  label("arm", bench().phase === "armed" ? "Disarm" : "Arm trigger");
  $("share").hidden = !run.share;
  if (bench().report === "ready" && report_asked) { report_asked = false; location.assign("/v1/report"); }
}

let answered = null;
function question(title, fields) {
  $("ask-title").textContent = title;
  $("ask-fields").replaceChildren(...fields.map(([name, text, value, kind]) => {
    const box = document.createElement("label"), input = document.createElement("input");
    input.name = name;
    input.value = value;
    if (kind === "number") { input.type = "number"; input.step = "any"; input.required = true; input.inputMode = "decimal"; }
    box.append(text, input);
    return box;
  }));
  $("ask").showModal();
  const first = $("ask-fields").querySelector("input");
  if (first) first.select(); else $("ask-ok").focus();
  return new Promise((resolve) => { answered = resolve; });
}
$("ask-form").addEventListener("submit", (event) => {
  event.preventDefault();
  const given = {};
  for (const input of $("ask-fields").querySelectorAll("input")) given[input.name] = input.value;
  answered(given);
  answered = null;
  $("ask").close();
});
$("ask-cancel").addEventListener("click", () => $("ask").close());
$("ask").addEventListener("close", () => { if (answered) answered(null); answered = null; });
$("viewers-close").addEventListener("click", () => $("viewers").close());

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

function scrub(to) {
  const all = samples[0], first = all.t[0], last = all.t[all.count - 1];
  play_time = Math.min(last, Math.max(first, to));
  $("time").value = (play_time - first) / (last - first);
  if (WINDOWS[window_index] === Infinity) window_index = 1, show_window();
  dirty = true;
}

let report_asked = false;
const ACTIONS = {
  zero() { ask_server({ type: "zero" }); },
  async ruler() {
    const given = await question("Calibrate with a ruler: hold the target still", [["known_m", "Its distance from the sensor by the ruler, mm", "250", "number"]]);
    if (given) ask_server({ type: "ruler", known_m: Number(given.known_m) / 1e3 });
  },
  async arm() {
    if (bench().phase === "armed") { ask_server({ type: "disarm" }); return; }
    const given = await question("Record when the bob leaves its rest", [["threshold", "by more than, mm", "10", "number"], ["keep", "seconds kept from before", "2", "number"]]);
    if (given) ask_server({ type: "arm", threshold_m: Number(given.threshold) / 1e3, keep_s: Number(given.keep) });
  },
  record() { ask_server({ type: "record" }); },
  async mark() {
    const given = await question("Mark this moment", [["text", "Text", "mark"]]);
    if (given) ask_server({ type: "mark", text: given.text || "mark" });
  },
  async note() {
    const given = await question("Note for this run", [["text", "Text", ""]]);
    if (given && given.text.trim()) ask_server({ type: "note", text: given.text });
  },
  async stop() { if (await question("Stop the recording? Its run file is built then.", [])) ask_server({ type: "stop" }); },
  report() {
    if (bench().report === "ready") { location.assign("/v1/report"); return; }
    report_asked = true;
    ask_server({ type: "report" });
  },
  async discard() { if (await question("Put this run aside? It goes to a folder beside; nothing is deleted.", [])) ask_server({ type: "discard" }); },
  async close() { if (await question("Close the page?", [])) ask_server({ type: "close" }); },
  play,
  freeze() { frozen = !frozen; press("freeze", frozen); dirty = true; },
  axes() { fixed = !fixed; press("axes", fixed); dirty = true; },
  window() { window_index = (window_index + 1) % WINDOWS.length; show_window(); dirty = true; },
  "cursor-on"() {
    cursor_on = !cursor_on;
    press("cursor-on", cursor_on);
    if (cursor_on) { move_cursor(0); return; }
    pinned = null;
    position.plot.setCursor({ left: -10, top: -10 });
  },
  "region-fit"() {
    const here = at_cursor();
    if (pinned && here && here[0] !== pinned[0]) fit_between(pinned[0], here[0]); else fit_between(...in_view());
  },
  csv() {
    const [from, end] = in_view(), all = samples[0];
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
    const words = e && e.period ? `Period ${e.period.value.toFixed(3)} seconds` + (e.amplitude_now ? `, amplitude ${(e.amplitude_now.value * scale()).toFixed(1)} ${unit() === "mm" ? "millimetres" : unit()}` : "") : "No motion yet";
    say(words);
    if (window.speechSynthesis) { speechSynthesis.cancel(); speechSynthesis.speak(new SpeechSynthesisUtterance(words)); }
  },
  share() {
    $("code").src = "/v1/code.svg";
    $("code").hidden = false;
    $("address").textContent = run.share;
    $("viewers").showModal();
  },
};
for (const button of document.querySelectorAll("#actions button")) button.addEventListener("click", () => ACTIONS[button.id]());

// What has the focus takes the key itself: a field or a list all of them, a slider those that move it, a box the space.
function takes(target, key) {
  if (target.type === "range") return /^(Arrow|Page|Home|End)/.test(key);
  if (target.type === "checkbox") return key === " ";
  return /^(INPUT|SELECT)$/.test(target.tagName);
}

document.addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey || document.querySelector("dialog[open]") || takes(event.target, event.key)) return;
  const arrow = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
  if (arrow && run && run.source === "REPLAY" && !cursor_on) { event.preventDefault(); scrub(end_time() + arrow * (event.shiftKey ? 10 : 1)); return; }
  if (arrow && cursor_on) { event.preventDefault(); move_cursor(arrow * (event.shiftKey ? 10 : 1)); return; }
  if (event.key === "Enter" && cursor_on && event.target.tagName !== "BUTTON") { event.preventDefault(); pin(); return; }
  const button = [...document.querySelectorAll("#actions button")].find((b) => b.dataset.key === event.key.toLowerCase() && !b.hidden);
  if (button) { event.preventDefault(); ACTIONS[button.id](); }
});
$("time").addEventListener("input", () => {
  const all = samples[0];
  scrub(all.t[0] + Number($("time").value) * (all.t[all.count - 1] - all.t[0]));
});
connect();
requestAnimationFrame(draw);
