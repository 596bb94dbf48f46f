"use strict";
// A card: one recording with its questions, its bench, its results. Every text from a file becomes a text node.

function element(name, content = "", more = {}) {
  const made = document.createElement(name), { dataset, ...fields } = more;
  made.append(...(Array.isArray(content) ? content : [content]));
  Object.assign(made, fields);
  Object.assign(made.dataset, dataset || {});
  return made;
}
const row = (cells, of = "td") => element("tr", cells.map((cell) => (cell instanceof Node ? cell : element(of, cell))));
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

const STAGES = { waiting: "Waiting ...", reading: "Reading ...", analysing: "Analysing ...", done: "", question: "Needs an answer", failed: "Not read" };

class Card {
  constructor(id) {
    this.id = id;
    this.box = document.getElementById("card").content.firstElementChild.cloneNode(true);
    this.shown = { charts: new Map(), version: 0 };
    this.pending = {};
    this.box.setAttribute("aria-labelledby", (this.at(".name").id = new_id()));
    for (const form of this.box.querySelectorAll("form")) form.addEventListener("submit", (event) => event.preventDefault());
    this.stop = makeButton("Stop", () => act("stop", { card: id }));
    this.again = makeButton("Try again", () => this.change({}));
    this.at(".card-buttons").append(this.stop, this.again, makeButton("Remove", () => act("remove", { card: id })));
    this.fields = new Map();
  }

  at(selector) { return this.box.querySelector(selector); }
  change(changes) { return act("change", { card: this.id, changes }); }

  show(message) {
    const before = this.message || {};
    this.message = message;
    const { stage, opened, question, form } = message, waits = ["waiting", "reading", "analysing"].includes(stage);
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
    for (const part of [".left", ".right"]) this.at(part).hidden = !opened || stage === "question" || stage === "failed";
    if (stage === "done" && message.version !== this.shown.version) this.load(message.version);
    if (stage === "question" || stage === "failed") this.clear();
  }

  tick() {
    const { stage } = this.message, seconds = Math.floor((performance.now() - this.since) / 1000);
    this.at(".stage").textContent = STAGES[stage] + (seconds > 1 && STAGES[stage].endsWith("...") ? ` ${seconds} s` : "");
  }

  clear() {
    for (const part of [".values", ".words", ".findings-of", ".more"]) this.at(part).hidden = true;
    this.at(".shown").replaceChildren();
    this.at(".outline").hidden = false;
    this.shown = { charts: new Map(), version: 0 };
  }

  show_opened(opened) {
    this.at(".facts").replaceChildren(...(opened.simulated ? [element("span", "simulated, not measured", { className: "kind" }), " "] : []), [opened.format, ...opened.facts].join(" · "), opened.recorded ? ` · ${opened.recorded}` : "");
    const fold = this.at(".assumed");
    fold.hidden = !opened.assumed.length;
    fold.querySelector("summary").textContent = `What was assumed and noticed while reading (${opened.assumed.length})`;
    fold.querySelector("ul").replaceChildren(...opened.assumed.map((text) => element("li", text)));
    this.draw(this.at(".outline"), { ...opened.outline, caption: "" });
  }

  // A question stays as fields, also once it is answered, so that an answer can be changed.
  show_question({ stage, question, asked, answers }) {
    const form = this.at(".question");
    form.hidden = !(asked && asked.length) || (stage === "failed" && !Object.keys(answers).length);
    if (form.hidden) return;
    const open = stage === "question" ? question : null;
    form.classList.toggle("answered", !open);
    form.querySelector("h3").textContent = open ? "This file leaves something open" : "Your answers";
    form.querySelector(".reason").textContent = open ? open.reason : "";
    form.querySelector(".rows").hidden = !(open && open.rows.length);
    if (open && open.rows.length) {
      const [head, ...rows] = open.rows;
      form.querySelector("table").replaceChildren(element("thead", row(head.map((cell) => element("th", cell, { scope: "col" })))), element("tbody", rows.map((cells) => row(cells))));
    }
    const place = form.querySelector(".fields");
    for (const field of asked) {
      const known = this.fields.get(field.name), same = known && JSON.stringify(known.field) === JSON.stringify(field);
      if (same) { if (document.activeElement !== known.input) known.input.value = answers[field.name] || ""; continue; }
      const input = field.choices.length ? choices(element("select"), [{ value: "", label: "choose ..." }, ...field.choices.map((each) => ({ value: each, label: each === "1" ? "1 (a plain number)" : each }))], answers[field.name] || "") : element("input", "", { inputMode: "decimal", value: answers[field.name] || "", autocomplete: "off" });
      input.id = new_id();
      input.addEventListener("change", () => this.answer(field.name, input.value));
      const words = field.name === "rate_hz" ? "Rate in samples per second" : field.label;
      const label = element("div", [element("label", words, { htmlFor: input.id }), input], { className: "field" });
      if (field.name === "run" && field.choices.length > 1) label.append(makeButton("A card for each run", () => act("separate", { card: this.id })));
      if (known) known.label.replaceWith(label); else place.append(label);
      this.fields.set(field.name, { field, input, label });
    }
  }

  answer(name, value) {
    const answers = { ...this.message.answers, [name]: value.trim().replace(",", ".").trim() };
    if (name !== "rate_hz") answers[name] = value;
    if (!value) delete answers[name];
    // The unit belongs to the column, and everything to the run.
    if (name === "channel") delete answers.unit;
    if (name === "time") delete answers.time_unit;
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
    const pending = this.pending;
    const bench = { ...this.message.bench, ...pending };
    await this.change({ bench });
    if (this.pending === pending) this.pending = {};
  }

  show_how({ from_s, to_s, law, accuracy, opened }) {
    const place = this.at(".how .fields");
    if (!this.how) {
      this.how = {
        from_s: element("input", "", { inputMode: "decimal", size: 7 }), to_s: element("input", "", { inputMode: "decimal", size: 7 }),
        law: choices(element("select"), [{ value: "", label: "the one that fits best" }, ...LAWS], ""),
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
    words.replaceChildren(...found.summary.map(([title, text]) => element("p", [element("b", `${title}. `), text])));
    this.show_findings(found.findings);
    const at_once = found.charts.filter(({ name }) => ["position", "amplitude", "spectrum"].includes(name)), others = found.charts.filter((chart) => !at_once.includes(chart));
    this.draw_all(this.at(".shown"), at_once);
    const fold = this.at(".more"), place = fold.querySelector(".figures");
    fold.hidden = !others.length;
    fold.ontoggle = () => { if (fold.open) this.draw_all(place, others); };
    fold.ontoggle();
  }

  draw_all(place, charts) {
    const boxes = new Map([...place.children].map((figure) => [figure.dataset.name, figure]));
    place.replaceChildren(...charts.map((chart) => boxes.get(chart.name) || element("figure", "", { dataset: { name: chart.name } })));
    charts.forEach((chart, i) => this.draw(place.children[i], chart));
  }

  show_values({ rows, graded }) {
    const table = this.at("table.results"), quoted = rows.some(({ grade }) => grade);
    this.at(".values").hidden = false;
    const heads = ["quantity", "", term("value ± u", TERMS.u), ...(quoted ? [term("quote it?", TERMS.grade)] : [])];
    const lines = rows.map(({ name, quantity, symbol, value, note, grade, why, cells }) => {
      const [letter, index] = symbol.split(" ");
      const sign = element("td", [element("i", letter), ...(index ? [element("sub", index)] : [])]);
      const shown = note ? element("td", note, { className: "needs" }) : element("td", value, { className: "num" });
      const line = row([element("th", term(quantity, TERMS[name]), { scope: "row" }), sign, shown, ...(quoted ? [element("td", grade, { className: `grade ${grade.replaceAll(" ", "-")}`, title: why })] : [])]);
      line.dataset.name = name;
      line.dataset.cells = cells;
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
    const box = element("div", "", { className: "chart", id: new_id() });
    figure.replaceChildren(box, ...(chart.caption ? [element("figcaption", [element("b", `${chart.title}. `), chart.caption])] : []));
    const made = new Chart(box, decoded(JSON.parse(text)));
    if (key === "position") made.bar.append(makeButton("Analyse only what is shown", () => {
      const [from, to] = made.range(made.chart.panels[0].x_label);
      this.change({ from_s: Number(from.toFixed(4)), to_s: Number(to.toFixed(4)) });
    }));
  }
}
