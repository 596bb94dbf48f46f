"use strict";
// The window: what is dropped goes to the server in this computer, and its cards come back over a connection that stays
// open. Every request that changes something has a header that no other page can send.
const $ = (id) => document.getElementById(id);
const cards = new Map();
let socket = null, wait_ms = 250, KNOWN = {};

function complain(text) { $("message").textContent = text; $("message").hidden = !text; if (text) $("message").scrollIntoView({ block: "nearest" }); }

async function post(address, body, say = (text) => complain(`Not done: ${text}`)) {
  try {
    const answered = await fetch(address, { method: "POST", body, headers: { "X-Springmass": "window" } }), found = await answered.json();
    if (answered.ok) return found;
    say(`${found.refused.replace(/\.$/, "")}.`);
  } catch {
    complain("The program behind this window has ended. Open springmass again: your recordings are offered there for a day.");
  }
  return null;
}
function act(what, more = {}, say = undefined) {
  complain("");
  return post("/window/do", JSON.stringify({ do: what, ...more }), say);
}

// Entries of what was dropped: files, each with the folder that it lies in.
async function files_of(entry, folder = "") {
  if (entry.isFile) return [[await new Promise((done, failed) => entry.file(done, failed)), folder]];
  const reader = entry.createReader(), found = [];
  for (let some = [null]; some.length;) {
    some = await new Promise((done, failed) => reader.readEntries(done, failed));
    for (const each of some) found.push(...await files_of(each, `${folder}/${entry.name}`));
  }
  return found;
}

async function upload(files, card = "") {
  const drop = crypto.randomUUID(), kept = files.filter(([file]) => !file.name.startsWith("."));
  complain("");
  for (const [i, [file, folder]] of kept.entries()) {
    $("busy").textContent = kept.length > 1 ? `Taking file ${i + 1} of ${kept.length}: ${file.name}` : `Taking ${file.name}`;
    if (await post(`/window/files?${new URLSearchParams({ drop, folder: folder.slice(0, 500), name: file.name })}`, file) === null) break;
  }
  $("busy").textContent = "";
  const said = $("message").textContent;
  if (await post("/window/do", JSON.stringify({ do: "open", drop, card })) && said) complain(said);
}

for (const [id, of] of [["files", () => ""], ["folder", (file) => file.webkitRelativePath.replace(/\/[^/]*$/, "")]]) {
  $(id).addEventListener("change", () => { upload([...$(id).files].map((file) => [file, of(file)])); $(id).value = ""; });
}
addEventListener("dragover", (event) => { event.preventDefault(); document.body.classList.add("over"); });
addEventListener("dragleave", (event) => { if (!event.relatedTarget) document.body.classList.remove("over"); });
addEventListener("drop", async (event) => {
  event.preventDefault();
  document.body.classList.remove("over");
  const entries = [...event.dataTransfer.items].map((item) => item.webkitGetAsEntry()).filter(Boolean), on = event.target.closest("[data-card]");
  const found = (await Promise.all(entries.map((entry) => files_of(entry)))).flat();
  if (found.length) upload(found, on ? on.dataset.card : "");
});
const first = makeButton("Choose files", () => $("files").click());
first.className = "primary";
$("open-buttons").append(first, makeButton("Choose a folder", () => $("folder").click()), makeButton("Try an example", () => act("examples")));

function connect() {
  socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/window/events`);
  socket.onopen = () => { wait_ms = 250; complain(""); };
  socket.onmessage = ({ data }) => receive(JSON.parse(data));
  socket.onclose = () => {
    complain("The program behind this window does not answer. If it has ended, open springmass again: your recordings are offered there for a day.");
    setTimeout(connect, wait_ms);
    wait_ms = Math.min(2 * wait_ms, 5000);
  };
}

function receive(message) {
  if (message.type === "card") { cards.get(message.id)?.show(message); show_together(); return; }
  if (message.type === "recorder") { show_recorder(message); return; }
  KNOWN = message;
  for (const id of message.order) if (!cards.has(id)) {
    const card = new RecordingCard(id);
    card.box.dataset.card = id;
    cards.set(id, card);
    $("cards").prepend(card.box);
  }
  for (const [id, card] of cards) if (!message.order.includes(id)) { card.box.remove(); cards.delete(id); }
  document.body.classList.toggle("empty", !message.order.length);
  show_together();
  $("earlier").replaceChildren(...message.earlier.map(({ id, names }) => element("p", [
    `An earlier window left ${names.length === 1 ? "a recording" : `${names.length} recordings`}: ${names.slice(0, 4).join(", ")}${names.length > 4 ? " ..." : ""} `,
    makeButton("Open again", () => act("restore", { window: id })), " ", makeButton("Forget", () => act("forget", { window: id })),
  ])));
}

addEventListener("beforeunload", (event) => {
  if ([...cards.values()].some(({ message }) => message && !message.saved && (Object.keys(message.answers).length || Object.keys(message.bench).length || message.notes))) event.preventDefault();
});
setInterval(() => { for (const card of cards.values()) if (card.message) card.tick(); }, 1000);
addEventListener("load", connect);
