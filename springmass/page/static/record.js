"use strict";
// Recording: which port and sensor, where the file goes, and the live page of the recorder, which outlives this window.

const Recorder = { fields: {}, tab: null };

function record_field(name, words, input) {
  input.id = new_id();
  Recorder.fields[name] = input;
  $("record").querySelector(".fields").append(element("div", [element("label", words, { htmlFor: input.id }), input], { className: "field" }));
}

async function begin_record() {
  $("record").hidden = false;
  $("record").scrollIntoView({ block: "nearest" });
  if (!Recorder.fields.port) {
    record_field("port", "Sensor at", choices(element("select"), [{ value: "", label: "looking for sensors ..." }], ""));
    record_field("sensor", "Kind of sensor", element("select"));
    record_field("title", "Name of the recording", element("input", "", { maxLength: 60 }));
    record_field("folder", "Kept in the folder", element("input", "", { size: 36, value: Recorder.folder || "" }));
    const start = makeButton("Start the recorder", start_record), look = makeButton("Look again", find_ports);
    start.className = "primary";
    $("record").querySelector(".fields").append(start, look);
  }
  await find_ports();
  Recorder.fields.port.focus();
}

async function find_ports() {
  const { port, sensor } = Recorder.fields, found = await act("ports");
  if (!found) return;
  choices(port, [...found.ports.map(({ device, description, heard, families }) => ({ value: device, label: `${device} ${families.length ? `(${families.join(", ")})` : heard || description}` })), { value: "simulate", label: "simulated bench, to try it" }], "");
  port.selectedIndex = 0;
  const known = () => found.ports.find(({ device }) => device === port.value)?.families || [];
  const offer = () => choices(sensor, [{ value: "", label: "find out" }, ...found.sensors.map(({ name, title }) => ({ value: name, label: `${name}: ${title}`.slice(0, 60) }))], known()[0] || "");
  port.onchange = offer;
  offer();
}

async function start_record() {
  Recorder.tab = open("about:blank");
  if (!await act("record", Object.fromEntries(Object.entries(Recorder.fields).map(([name, { value }]) => [name, value])))) Recorder.tab?.close();
}

function show_recorder({ folder, address, run, said, running }) {
  Recorder.folder = folder;
  if (Recorder.fields.folder && document.activeElement !== Recorder.fields.folder) Recorder.fields.folder.value = folder;
  if (address && Recorder.tab) { Recorder.tab.location = address; Recorder.tab = null; }
  $("recorder").replaceChildren(...(running ? [`The recorder writes to ${run}. It goes on when this window is closed. `, ...(address ? [element("a", "Show its live page", { href: address, target: "_blank" }), " "] : []), makeButton("End the recorder", () => act("end"))] : said ? [said] : []));
  if (running || said) $("record").hidden = false;
}
$("open-buttons").append(makeButton("Record", begin_record));
