"use strict";
// The comparison: which recordings, the mass of each bob, Hooke's points, and what follows from them.

const Together = { left_out: new Set(), asked: "", timer: 0, points: [], drawn: new Map() };

function numbers(...labels) { return labels.map((label) => element("input", "", { inputMode: "decimal", autocomplete: "off", ariaLabel: label, size: 7 })); }

function add_point() {
  const count = Together.points.length + 1, point = numbers(`Mass ${count} in g`, `Position ${count} in cm`);
  Together.points.push(point);
  for (const input of point) input.addEventListener("input", () => { if (point === Together.points.at(-1)) add_point(); show_together(); });
  $("hooke").querySelector("tbody").append(row([String(count), ...point]));
}
$("hooke").querySelector("table").append(element("thead", row(["point", "mass / g", "position / cm"].map((head) => element("th", head, { scope: "col" })))), element("tbody"));
for (let i = 0; i < 3; i++) add_point();

const lines = new Map();
function line_of(card) {
  const name = "bob.mass_kg", label = card.message.name, [mass, u] = numbers(`Mass of the bob of ${label} in g`, `u of the mass of the bob of ${label}`);
  const box = element("input", "", { type: "checkbox", checked: true, ariaLabel: `Compare ${label}` });
  box.addEventListener("change", () => { if (box.checked) Together.left_out.delete(card.id); else Together.left_out.add(card.id); show_together(); });
  for (const input of [mass, u]) input.addEventListener("change", () => card.change({ bench: { [name]: { text: mass.value, u: u.value, unit: "g" } } }));
  const show = () => {
    const field = card.message.form.find((each) => each.name === name);
    if (field.unit === "g") for (const [input, text] of [[mass, field.text], [u, field.u]]) if (document.activeElement !== input) input.value = text;
  };
  return { line: row([box, element("th", label, { scope: "row" }), mass, u]), show };
}

// Ask for the comparison again when something of it has changed, a moment after the last change.
function show_together() {
  const done = [...cards.values()].filter(({ message }) => message && message.stage === "done" && message.form);
  $("compare").hidden = done.length < 2 && !Together.points[0][0].value;
  for (const card of done) {
    if (!lines.has(card.id)) lines.set(card.id, line_of(card));
    lines.get(card.id).show();
  }
  const table = $("compare").querySelector("table"), body = done.map(({ id }) => lines.get(id).line);
  if (!table.tHead) table.append(element("thead", row(["compare", "recording", "mass of the bob / g", "± u / g"].map((head) => element("th", head, { scope: "col" })))), element("tbody"));
  if (body.some((line, i) => table.tBodies[0].rows[i] !== line) || table.tBodies[0].rows.length !== body.length) table.tBodies[0].replaceChildren(...body);
  const chosen = done.filter(({ id }) => !Together.left_out.has(id)), hooke = Together.points.map((point) => point.map(({ value }) => value.trim().replace(",", "."))).filter(([mass, position]) => mass && position);
  const asked = JSON.stringify([chosen.map(({ id, message }) => [id, message.version]), hooke]);
  if (asked === Together.asked) return;
  Together.asked = asked;
  clearTimeout(Together.timer);
  Together.timer = setTimeout(() => compare(chosen, hooke), 400);
}

async function compare(chosen, hooke) {
  if (chosen.length < 2 && hooke.length < 2) { $("verdict").textContent = ""; $("compared").replaceChildren(); return; }
  $("verdict").textContent = "Comparing ...";
  const found = await act("compare", { cards: chosen.length > 1 ? chosen.map(({ id }) => id) : [], hooke, columns: ["mass (g)", "position (cm)"] }, (text) => { $("verdict").textContent = text; });
  if (!found) { $("compared").replaceChildren(); return; }
  $("verdict").textContent = found.verdict;
  const heads = ["recording", "spring constant", "residual / u"].map((head) => element("th", head, { scope: "col" }));
  const figures = element("div", found.charts.map(() => element("figure")), { className: "figures" });
  $("compared").replaceChildren(...found.findings.map((text) => element("p", text)), ...(found.rows.length ? [element("table", [element("thead", row(heads)), element("tbody", found.rows.map((cells) => row(cells)))])] : []), figures);
  found.charts.forEach((chart, i) => draw_chart(figures.children[i], chart));
}
