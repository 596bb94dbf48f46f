"use strict";
// Each action has a key and a button. show_state shows the result of a request once the recorder has acknowledged it.
function press(button, on) { $(button).setAttribute("aria-pressed", String(on)); }
function label(button, text) { $(button).firstChild.textContent = `${text} `; }
function show_window() { const s = WINDOWS[window_index]; label("window", s === Infinity ? "all" : `${s} s`); }

// The requests that the server accepts now, by the id of their button; viewers can make none.
const allowed = () => (run.role === "controller" && bench().requests) || [];

function show_actions() {
  const possible = allowed();
  for (const id of ["zero", "arm", "record", "mark", "note", "stop", "report", "discard", "close"]) $(id).hidden = !possible.includes(id);
  $("report").classList.toggle("primary", bench().phase === "built");
  label("arm", bench().phase === "armed" ? "Disarm" : "Arm trigger");
  $("share").hidden = !run.share;
  if (bench().report === "ready" && report_asked) { report_asked = false; location.assign("/v2/report"); }
}

// The recorder may change its phase while a dialog is open; a request that it no longer accepts is reported.
let refused = "", refused_until = 0;
function request(id, message) {
  if (allowed().includes(id)) { ask_server(message); return; }
  refused = `Not done: the recorder was at "${PHASES[bench().phase] || bench().phase}"; try again.`;
  refused_until = performance.now() + 6000;
  show_state();
}

let answered = null, checks = {};
// A field has a name, a label and a value. The field of a quantity also has a check, which returns the number or throws
// an error.
function question(title, fields, ok) {
  $("ask-title").textContent = title;
  $("ask-ok").textContent = ok || "OK";
  $("ask-error").hidden = true;
  checks = Object.fromEntries(fields.map(([name, , , check]) => [name, check || String]));
  $("ask-fields").replaceChildren(...fields.map(([name, text, value]) => element("label", [text, element("input", "", { name, value })])));
  $("ask").showModal();
  const first = $("ask-fields").querySelector("input");
  if (first) first.select(); else $("ask-ok").focus();
  return new Promise((resolve) => { answered = resolve; });
}

const IN_METRES = { m: 1, cm: 1e-2, mm: 1e-3 };
// Returns a parser of lengths with a unit, or else in mm; the result is in m, from ``least`` to ``most``.
function length_between(least, most, example) {
  return (text) => {
    const read = /^\s*(\d+(?:[.,]\d+)?|[.,]\d+)\s*(mm|cm|m)?\s*$/i.exec(text);
    if (!read) throw new RangeError(`Cannot read "${text}" as a length; write for example ${example}.`);
    const number = Number(read[1].replace(",", ".")), metres = number * IN_METRES[(read[2] || "mm").toLowerCase()];
    if (metres >= least && metres <= most) return metres;
    const meant = !read[2] && number >= least && number <= most ? ` Did you mean ${read[1]} m?` : "";
    throw new RangeError(`${read[1]} ${read[2] || "mm"} is not between ${least * 1e3} mm and ${most} m.${meant}`);
  };
}

function seconds_between(least, most) {
  return (text) => {
    const read = /^\s*(\d+(?:[.,]\d+)?)\s*s?\s*$/i.exec(text), number = read ? Number(read[1].replace(",", ".")) : NaN;
    if (number >= least && number <= most) return number;
    throw new RangeError(`Cannot use "${text}" as a time; write ${least} to ${most} s.`);
  };
}

$("ask-form").addEventListener("submit", (event) => {
  event.preventDefault();
  const given = {};
  for (const input of $("ask-fields").querySelectorAll("input")) {
    input.removeAttribute("aria-invalid");
    try { given[input.name] = checks[input.name](input.value); } catch (error) {
      if (!(error instanceof RangeError)) throw error;
      input.setAttribute("aria-invalid", "true");
      $("ask-error").textContent = error.message;
      $("ask-error").hidden = false;
      input.select();
      return;
    }
  }
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
  async arm() {
    if (bench().phase === "armed") { ask_server({ type: "disarm" }); return; }
    const given = await question("Record when the bob leaves its rest", [["threshold", "Threshold", "10 mm", length_between(1e-4, 1, "10 mm or 1 cm")], ["keep", "Pre-trigger time", "2 s", seconds_between(0, 60)]], "Arm");
    if (given) request("arm", { type: "arm", threshold_m: given.threshold, keep_s: given.keep });
  },
  record() { ask_server({ type: "record" }); },
  async mark() {
    const given = await question("Mark this moment", [["text", "Text", "mark"]]);
    if (given) request("mark", { type: "mark", text: given.text || "mark" });
  },
  async note() {
    const given = await question("Note for this run", [["text", "Text", ""]]);
    if (given && given.text.trim()) request("note", { type: "note", text: given.text });
  },
  async stop() { if (await question("Stop and save?", [], "Stop")) ask_server({ type: "stop" }); },
  report() {
    if (bench().report === "ready") { location.assign("/v2/report"); return; }
    report_asked = true;
    ask_server({ type: "report" });
  },
  async discard() { if (await question("Set this run aside? It is moved to the folder discarded; nothing is deleted.", [], "Set aside")) ask_server({ type: "discard" }); },
  async close() { if (await question("Close the page?", [], "Close")) ask_server({ type: "close" }); },
  play,
  freeze() { frozen = !frozen; press("freeze", frozen); dirty = true; },
  axes() { fixed = !fixed; press("axes", fixed); dirty = true; },
  window() { window_index = (window_index + 1) % WINDOWS.length; show_window(); dirty = true; },
  "cursor-on"() {
    cursor_on = !cursor_on;
    press("cursor-on", cursor_on);
    if (cursor_on) { move_cursor(0); return; }
    pinned = cursor = null;
    show_cursor();
    redraw();
  },
  "region-fit"() {
    if (pinned && cursor && cursor[0] !== pinned[0]) select_between(pinned[0], cursor[0]);
    else if (selection) select_between(selection.from, selection.to);
    else select_between(...in_view());
  },
  csv() {
    const [from, end] = in_view(), all = samples[0];
    let text = `time_s,${run.quantity === "length" ? "distance_m" : `${run.quantity}_${run.unit}`}\n`;
    for (let i = all.at(from); i < all.count && all.t[i] <= end; i++) text += `${all.t[i]},${Number.isNaN(all.y[i]) ? "" : all.y[i]}\n`;
    const href = URL.createObjectURL(new Blob([text], { type: "text/csv" }));
    element("a", "", { href, download: `${run.name.replace(/\.[^.]*$/, "")}-view.csv` }).click();
    URL.revokeObjectURL(href);
    say("Samples in view saved as CSV");
  },
  share() {
    $("code").src = "/v2/code.svg";
    $("code").hidden = false;
    $("address").textContent = run.share;
    $("viewers").showModal();
  },
  more() { $("more").setAttribute("aria-expanded", String($("groups").classList.toggle("open"))); },
};
$("unfold").addEventListener("click", () => {
  const unfolded = document.body.classList.toggle("unfolded");
  $("unfold").setAttribute("aria-expanded", String(unfolded));
  $("unfold").textContent = unfolded ? "Show less" : "Show all";
});
for (const button of document.querySelectorAll("#actions button")) button.addEventListener("click", () => ACTIONS[button.id]());

// The focused element keeps its own keys: a field or a list keeps all keys, a slider the keys that move it, a checkbox
// the space bar.
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
  if (event.key === "Escape" && selection) { selection = region = null; show_selection(); return; }
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
