"use strict";
// A card: one recording with its questions, its bench, its results. Every text from a file becomes a text node.

const row = (cells, of = "td") => element("tr", cells.map((cell) => (["TD", "TH"].includes(cell.tagName) ? cell : element(of, cell))));
function choices(select, items, value) {
  select.replaceChildren(...items.map(({ value: each, label }) => element("option", label, { value: each })));
  select.value = value;
  return select;
}
let last_number = 0;
const new_id = () => `id-${(last_number += 1)}`;

const TERMS = {
  period: "The time of one full swing, down and up again.",
  spring_constant: "The force that stretches the spring by one metre. It follows from the period and the mass that swings.",
  frequency: "Swings in one second: one over the period.",
  angular_frequency: "2π times the frequency.",
  amplitude: "The largest distance from the rest position, at the start of the swing.",
  damping_rate: "How fast the amplitude falls at the start: in one second by about this share of itself.",
  quality_factor: "A large Q means little damping: after Q/π swings the amplitude has fallen to a third.",
  noise: "How much a single sample scatters about the motion.",
  offset: "Where the bob hangs when it does not swing.",
  u: "u, the number after ±, is one standard uncertainty: the true value is within ±u in two of three cases, and within ±2u in 19 of 20.",
  grade: "Sound: you may quote the value with its u. Uncertain: something speaks against the model behind it, or it has few certain digits. Do not quote: it is not what its name says.",
};
// A word with a small button that explains it.
function term(words, text) {
  if (!text) return [words];
  const button = makeButton("?", () => {
    const place = $("explanation"), { left, bottom } = button.getBoundingClientRect();
    place.textContent = text;
    place.showPopover();
    place.style.left = `${Math.max(8, Math.min(left, innerWidth - place.offsetWidth - 8))}px`;
    place.style.top = `${Math.min(bottom + 6, innerHeight - place.offsetHeight - 8)}px`;
  }, `Explain: ${words}`);
  button.className = "term";
  return [`${words} `, button];
}

// A symbol in a sentence, as T_s, with its index lower.
function lowered(symbol) {
  const [letter, index] = symbol.split("_");
  return [letter, element("sub", index)];
}

function draw_chart(figure, chart) {
  const box = element("div", "", { className: "chart", id: new_id() });
  figure.replaceChildren(box, ...(chart.caption ? [element("figcaption", [element("b", `${chart.title}. `), chart.caption])] : []));
  return new Chart(box, decoded(structuredClone(chart)));
}

const STAGES = { waiting: "Waiting ...", reading: "Reading ...", analysing: "Analysing ...", done: "", question: "Needs an answer", failed: "Not read" };

class RecordingCard {
  constructor(id) {
    this.id = id;
    this.box = document.getElementById("card").content.firstElementChild.cloneNode(true);
    this.shown = { charts: new Map(), version: 0 };
    this.pending = {};
    this.box.setAttribute("aria-labelledby", (this.at(".name").id = new_id()));
    for (const form of this.box.querySelectorAll("form")) form.addEventListener("submit", (event) => event.preventDefault());
    this.stop = makeButton("Stop", () => act("stop", { card: id }));
    this.again = makeButton("Try again", () => this.change({}));
    // The second click of two meets the card that moved here.
    this.at(".card-buttons").append(this.stop, this.again, makeButton("Remove", (_, { detail }) => { if (detail < 2) act("remove", { card: id }); }));
    this.fields = new Map();
    this.make_away();
  }

  at(selector) { return this.box.querySelector(selector); }
  change(changes) { return act("change", { card: this.id, changes }); }

  show(message) {
    const before = this.message || {};
    this.message = message;
    const { stage, opened, question, form } = message, waits = ["waiting", "reading", "analysing"].includes(stage);
    for (const [name, cell] of Object.entries(this.pending)) if (JSON.stringify(message.bench[name]) === JSON.stringify(cell)) delete this.pending[name];
    this.at(".name").textContent = message.name;
    if (stage !== before.stage) this.since = performance.now();
    this.tick();
    this.box.dataset.stage = stage;
    this.stop.hidden = !waits;
    this.again.hidden = stage !== "failed";
    const bad = stage === "failed" ? message.problem : stage === "done" ? message.why : "";
    this.at(".problem").hidden = !bad;
    this.at(".problem").textContent = bad || "";
    if (opened && JSON.stringify(opened) !== JSON.stringify(before.opened)) this.show_opened(opened);
    this.show_question(message);
    const ready = opened && !["question", "failed"].includes(stage);
    if (form && ready) this.show_bench(form);
    for (const part of [".bench", ".how"]) this.at(part).hidden = !(form && ready);
    if (ready) this.show_how(message);
    if (document.activeElement !== this.at("textarea")) this.at("textarea").value = message.notes;
    for (const part of [".left", ".right"]) this.at(part).hidden = !opened || stage === "question" || stage === "failed";
    if (stage === "done" && message.version !== this.shown.version) this.load(message.version);
    if (stage === "question" || stage === "failed") this.clear();
    this.show_busy();
  }

  // Whether what is shown lacks something that was typed.
  show_busy() {
    const { stage, version } = this.message, drawn = stage === "done" ? this.shown.version === version : ["question", "failed"].includes(stage);
    this.box.ariaBusy = String(!drawn || Object.keys(this.pending).length > 0);
  }

  tick() {
    const { stage } = this.message, seconds = Math.floor((performance.now() - this.since) / 1000);
    this.at(".stage").textContent = STAGES[stage] + (seconds > 1 && STAGES[stage].endsWith("...") ? ` ${seconds} s` : "");
  }

  clear() {
    for (const part of [".values", ".words", ".findings-of", ".more", ".reported", ".away"]) this.at(part).hidden = true;
    this.at(".shown").replaceChildren();
    this.at(".outline").hidden = false;
    this.shown = { charts: new Map(), version: 0 };
  }

  show_opened(opened) {
    this.at(".facts").replaceChildren(...(opened.simulated ? [element("span", "simulated, not measured", { className: "kind" }), " "] : []), [opened.format, ...opened.facts].join(" · "), opened.recorded ? ` · ${opened.recorded}` : "");
    const fold = this.at(".assumed");
    const remarks = opened.assumed.length;
    const count = remarks ? `: ${remarks} remark${remarks > 1 ? "s" : ""}` : "";
    fold.querySelector("summary").textContent = `How it was read${count}`;
    fold.querySelector("ul").replaceChildren(...opened.assumed.map((text) => element("li", text)));
    this.draw(this.at(".outline"), { ...opened.outline, caption: "" });
  }

  // What a file leaves open is asked in the open, with its own choices; whatever else may be stated waits in a fold.
  show_question({ stage, question, asked, answers, opened, form: bench }) {
    const form = this.at(".question"), fold = this.at(".assumed"), open = stage === "question" ? question : null;
    const ours = opened && !opened.foreign, fields = new Map(KNOWN.reading.map((field) => [field.name, field]));
    for (const field of asked || []) fields.set(field.name, field);
    const now = new Set(open ? open.fields.map(({ name }) => name) : []);
    form.hidden = !open;
    fold.hidden = !open && stage !== "failed" && !bench;
    fold.querySelector("form").hidden = Boolean(ours);
    if (!opened) fold.querySelector("summary").textContent = "State how it is read";
    if (open) {
      form.querySelector(".reason").textContent = open.reason;
      form.querySelector(".rows").hidden = !open.rows.length;
      const [head, ...rows] = open.rows;
      if (head) form.querySelector("table").replaceChildren(element("thead", row(head.map((cell) => element("th", cell, { scope: "col" })))), element("tbody", rows.map((cells) => row(cells))));
    }
    for (const field of fields.values()) {
      const known = this.fields.get(field.name), label = known && JSON.stringify(known.field) === JSON.stringify(field) ? known.label : this.make_field(field, answers[field.name] || "");
      if (known && known.label !== label) known.label.remove();
      const { input } = this.fields.get(field.name), place = now.has(field.name) || (field.name in answers && open) ? form.querySelector(".fields") : fold.querySelector("form");
      if (document.activeElement !== input) input.value = answers[field.name] || "";
      if (label.parentElement !== place) { const had = document.activeElement === input; place.append(label); if (had) input.focus(); }
    }
  }

  make_field(field, value) {
    const options = [{ value: "", label: "choose ..." }, ...field.choices.map((each) => ({ value: each, label: each === "1" ? "1 (a plain number)" : each }))];
    const input = field.choices.length ? choices(element("select"), options, value) : element("input", "", { value, autocomplete: "off", size: 12 });
    input.id = new_id();
    input.addEventListener("change", () => this.answer(field.name, input.value));
    const label = element("div", [element("label", field.label, { htmlFor: input.id }), input], { className: "field" });
    if (field.name === "run" && field.choices.length > 1) label.append(makeButton("A card for each run", () => act("separate", { card: this.id })));
    this.fields.set(field.name, { field, input, label });
    return label;
  }

  answer(name, value) {
    const answers = { [name]: name === "rate_hz" ? value.trim().replace(",", ".") : value };
    // The unit belongs to the column, and everything to the run.
    if (name === "channel") answers.unit = "";
    if (name === "time") answers.time_unit = "";
    this.change({ answers });
  }

  show_bench(form) {
    if (!this.cells) {
      const [weighed, others] = this.box.querySelectorAll(".bench .fields");
      this.cells = new Map();
      for (const field of form) (field.name.endsWith(".mass_kg") ? weighed : others).append(this.make_cell(field));
    }
    if (form.some(({ name, error, doubt }) => (error || doubt) && !name.endsWith(".mass_kg"))) this.at(".bench details").open = true;
    for (const field of form) {
      const cell = this.cells.get(field.name);
      for (const [part, input] of Object.entries(cell.inputs)) if (document.activeElement !== input && !(field.name in this.pending)) input.value = field[part] || "";
      cell.wrong.textContent = field.error || field.doubt || "";
      cell.wrong.className = field.error ? "wrong" : "doubt";
      cell.inputs.text.setAttribute("aria-invalid", String(Boolean(field.error)));
    }
  }

  make_cell(field) {
    const name = new_id(), inputs = {}, wrong = element("p", "", { id: new_id() }), box = element("div", "", { className: "cell" });
    const typed = () => {
      this.pending[field.name] = Object.fromEntries(Object.entries(inputs).map(([part, input]) => [part, input.value]));
      this.show_busy();
      clearTimeout(this.timer);
      this.timer = setTimeout(() => this.send_bench(), 200);
    };
    if (field.choices) inputs.text = choices(element("select"), [{ value: "", label: "not known" }, ...field.choices.map((each) => ({ value: each, label: `${each} the bob` }))], field.text);
    else {
      inputs.text = element("input", "", { inputMode: "decimal", autocomplete: "off" });
      inputs.u = element("input", "", { inputMode: "decimal", autocomplete: "off", ariaLabel: `u of the ${field.label.toLowerCase()}` });
      inputs.unit = choices(element("select", "", { ariaLabel: `Unit of the ${field.label.toLowerCase()}` }), field.units, field.unit);
    }
    inputs.text.id = name;
    inputs.text.setAttribute("aria-describedby", wrong.id);
    for (const input of Object.values(inputs)) input.addEventListener("input", typed);
    box.append(element("div", [element("label", field.label, { htmlFor: name }), ...term("", field.help).slice(1).map((button) => Object.assign(button, { ariaLabel: `Explain: ${field.label}`, title: "" }))], { className: "label" }), inputs.text, ...(inputs.u ? [element("span", "±"), inputs.u, inputs.unit] : []), wrong);
    this.cells.set(field.name, { inputs, wrong });
    return box;
  }

  async send_bench() {
    if (!await this.change({ bench: this.pending })) this.pending = {};
  }

  // What a person takes away is made first, then loaded; a report opens in a tab of its own.
  make_away() {
    const ways = [["Open report", "report", "report"], ["Table as CSV", "report", "results.csv"], ["Amplitudes as CSV", "report", "amplitude.csv"], ["Table for LaTeX", "report", "table.tex"], ["Figures as PNG and SVG", "figures", "figures.zip"], ["Save run file", "run", "run.h5"]];
    const place = this.at(".away .card-buttons"), notes = this.at(".away textarea"), table = this.at("table.results");
    const buttons = ways.map(([words, what, file]) => makeButton(words, async (button) => {
      const address = `/window/cards/${this.id}/${file}`, tab = file === "report" ? open("about:blank") : null;
      button.disabled = true;
      const made = await act("write", { card: this.id, what });
      button.disabled = false;
      if (!made) tab?.close();
      else if (tab) tab.location = address;
      else element("a", "", { href: address, download: "" }).click();
    }));
    this.amplitudes = buttons[2];
    place.append(...buttons, makeButton("Copy for a spreadsheet", async (button) => {
      const done = await copyText(["quantity\tvalue\tu\tunit", ...[...table.querySelectorAll("tbody tr")].map((line) => `${line.dataset.quantity}\t${line.dataset.cells.replaceAll("|", "\t")}`)].join("\n"));
      button.textContent = done ? "Copied" : "Not allowed by the browser";
      setTimeout(() => { button.textContent = "Copy for a spreadsheet"; }, 1500);
    }));
    notes.addEventListener("change", () => this.change({ notes: notes.value }));
    const values = [["Period T", "period", ["s", "ms"]], ["Spring constant k", "spring_constant", ["N/m"]], ["Damping rate γ", "damping_rate", ["1/s"]]].map(([words, name, units]) => {
      const inputs = [words, `u of ${words}`].map((label) => element("input", "", { inputMode: "decimal", autocomplete: "off", ariaLabel: label }));
      const unit = choices(element("select", "", { ariaLabel: `Unit of ${words}` }), units.map((value) => ({ value, label: value })), units[0]);
      return { name, box: element("div", [element("label", words), inputs[0], "±", inputs[1], unit], { className: "cell" }), row: () => [name, inputs[0].value.replace(",", "."), inputs[1].value.replace(",", "."), unit.value] };
    });
    this.at(".reported .fields").append(...values.map(({ box }) => box), makeButton("Judge my values", async () => {
      const found = await act("judge", { card: this.id, rows: values.map(({ row }) => row()).filter(([, value]) => value.trim()) });
      if (found) this.at(".reported [role='status']").replaceChildren(...found.judged.map(({ name, printed, ours, verdict }) => element("p", [element("b", `${name.replaceAll("_", " ")} ${printed}: ${verdict}. `), `This recording gives ${ours}.`])), ...found.findings.map((text) => element("p", text)));
    }));
  }

  show_how({ from_s, to_s, law, accuracy, opened }) {
    const place = this.at(".how .fields");
    if (!this.how) {
      this.how = {
        from_s: element("input", "", { inputMode: "decimal", size: 7 }), to_s: element("input", "", { inputMode: "decimal", size: 7 }),
        law: choices(element("select"), [{ value: "", label: "the one that fits best" }, ...KNOWN.laws], ""),
        accuracy: choices(element("select"), [{ value: "fast", label: "fast" }, { value: "standard", label: "standard" }, { value: "best", label: "best, slower" }], "standard"),
      };
      const words = { from_s: "From (s)", to_s: "To (s)", law: "Law of damping", accuracy: "Accuracy" };
      for (const [name, input] of Object.entries(this.how)) {
        input.id = new_id();
        input.addEventListener("change", () => {
          if (!name.endsWith("_s")) { this.change({ [name]: input.value || null }); return; }
          const number = Number(input.value.replace(",", "."));
          this.change({ [name]: input.value.trim() && Number.isFinite(number) ? number : null });
        });
        place.append(element("div", [element("label", words[name], { htmlFor: input.id }), input], { className: "field" }));
      }
      this.whole = makeButton("Analyse the whole recording", () => this.change({ from_s: null, to_s: null }));
      place.append(this.whole);
    }
    const values = { from_s: from_s ?? "", to_s: to_s ?? "", law: law || "", accuracy: accuracy || "standard" };
    for (const [name, input] of Object.entries(this.how)) if (document.activeElement !== input) input.value = values[name];
    this.whole.hidden = from_s === null && to_s === null;
  }

  async load(version) {
    const answered = await fetch(`/window/cards/${this.id}/shown?${version}`);
    if (!answered.ok) return;
    const found = await answered.json();
    if (version < this.message.version) return;
    this.shown.version = version;
    this.show_values(found);
    this.at(".outline").hidden = true;
    const words = this.at(".words");
    words.hidden = false;
    words.replaceChildren(...found.summary.map(([title, parts]) => element("p", [element("b", `${title}. `), ...parts.flatMap((part, i) => (i % 2 ? lowered(part) : part))])));
    this.show_findings(found.findings);
    this.at(".reported").hidden = this.at(".away").hidden = false;
    const at_once = found.charts.filter(({ name }) => ["position", "amplitude", "spectrum"].includes(name)), others = found.charts.filter((chart) => !at_once.includes(chart));
    this.amplitudes.hidden = !at_once.some(({ name }) => name === "amplitude");
    this.draw_all(this.at(".shown"), at_once);
    const fold = this.at(".more"), place = fold.querySelector(".figures");
    fold.hidden = !others.length;
    fold.ontoggle = () => { if (fold.open) this.draw_all(place, others); };
    fold.ontoggle();
    this.show_busy();
  }

  draw_all(place, charts) {
    const boxes = new Map([...place.children].map((figure) => [figure.dataset.name, figure]));
    place.replaceChildren(...charts.map((chart) => boxes.get(chart.name) || element("figure", "", { dataset: { name: chart.name } })));
    charts.forEach((chart, i) => this.draw(place.children[i], chart));
  }

  show_values({ rows, graded }) {
    const table = this.at("table.results"), quoted = rows.some(({ grade }) => grade);
    this.at(".values").hidden = false;
    const heads = ["quantity", "symbol", term("value ± u", TERMS.u), ...(quoted ? [term("quote it?", TERMS.grade)] : [])];
    const lines = rows.map(({ name, quantity, symbol, value, note, grade, why, cells }) => {
      const [letter, index] = symbol.split(" ");
      const sign = element("td", [element("i", letter), ...(index ? [element("sub", index)] : [])]);
      const shown = note ? element("td", note, { className: "needs" }) : element("td", value, { className: "num" });
      const line = row([element("th", term(quantity, TERMS[name]), { scope: "row" }), sign, shown, ...(quoted ? [element("td", grade, { className: `grade ${grade.replaceAll(" ", "-")}`, title: why })] : [])]);
      line.dataset.name = name;
      Object.assign(line.dataset, { cells, quantity });
      return line;
    });
    table.replaceChildren(element("thead", row(heads.map((head) => element("th", head, { scope: "col" })))), element("tbody", lines));
    this.at(".values .note").textContent = graded && !quoted ? "Every value may be quoted." : "";
  }

  show_findings(findings) {
    this.at(".findings-of").hidden = !findings.length;
    this.at(".findings").replaceChildren(...findings.map((x) => element("li", [element("b", `${x.word}: `), x.message, ...(x.advice ? [" ", element("em", x.advice)] : []), ...(x.details ? [element("details", [element("summary", "More"), element("p", x.details)])] : [])], { className: x.severity })));
  }

  // A chart that has not changed stays as it is, with its zoom.
  draw(figure, chart) {
    const text = JSON.stringify(chart), key = chart.name;
    if (this.shown.charts.get(key) === text) return;
    this.shown.charts.set(key, text);
    const made = draw_chart(figure, chart);
    if (key === "position") made.bar.append(makeButton("Analyse only what is shown", () => {
      const [from, to] = made.range(made.chart.panels[0].x_label);
      this.change({ from_s: Number(from.toFixed(4)), to_s: Number(to.toFixed(4)) });
    }));
  }
}
