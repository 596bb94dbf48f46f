// The chart in a notebook: springmass/api/live.py builds its module from uPlot, charts.js, samples.js and this file.
function render({ model, el }) {
  const all = new Samples(), box = document.createElement("div"), said = document.createElement("div");
  let chart = null, scale = 1, dirty = false, over = false;
  said.textContent = "waiting for samples";
  el.append(box, said);
  const seconds = model.get("seconds");
  function begin(hello) {
    scale = hello.unit === "m" ? 1e3 : 1;
    const what = hello.quantity === "length" ? "distance" : hello.quantity, unit = hello.unit === "m" ? "mm" : hello.unit;
    const kind = hello.simulated ? "SIMULATED" : hello.source;
    said.textContent = `${kind}: ${hello.title || hello.name}`;
    box.style.height = "260px";
    chart = new Panel(box, { label: `${what} / ${unit}`, x_label: "time / s", log: null, series: [] }, { cursor: { show: false } });
  }
  function draw() {
    if (over) return;
    requestAnimationFrame(draw);
    if (!chart || !dirty || !all.count) return;
    dirty = false;
    const end = all.t[all.count - 1], from = seconds ? end - seconds : all.t[0];
    const [t, y] = all.between(from, end, Math.max(200, box.clientWidth)), shown = y.map((v) => (v === null ? null : v * scale));
    chart.show({ ...chart.panel, range: around(shown), series: [{ label: "samples", role: "data", line: true, x: t, y: shown }] });
  }
  model.on("msg:custom", (message, buffers) => {
    if (message.type === "hello" && !chart) begin(message);
    if (message.type !== "samples" || !buffers.length) return;
    const view = buffers[0], bytes = view.buffer ? view.buffer.slice(view.byteOffset, view.byteOffset + view.byteLength) : view;
    const [, sensor, first, count] = new Uint32Array(bytes, 0, 4);
    const known = all.count - first;  // all samples may have been sent again for another view of the widget
    if (sensor !== 0 || known < 0 || known >= count) return;
    const t = new Float64Array(bytes, 16, count), y = new Float64Array(bytes, 16 + 8 * count, count);
    all.take(all.count, t.subarray(known), y.subarray(known));
    dirty = true;
  });
  model.send({ type: "begin" });
  requestAnimationFrame(draw);
  return () => { over = true; if (chart) chart.destroy(); };
}
export default { render };
