// The chart in a notebook: springmass/api/live.py builds its module from uPlot, samples.js and this file.
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
    chart = new uPlot({
      width: box.clientWidth || 640, height: 260, legend: { show: false }, scales: { x: { time: false } },
      series: [{}, { stroke: "#0072b2", width: 1, points: { show: false } }],
      axes: [{ label: "time / s", stroke: "#808080" }, { label: `${what} / ${unit}`, stroke: "#808080", size: 60 }],
    }, [[], []], box);
  }
  function draw() {
    if (over) return;
    requestAnimationFrame(draw);
    if (!chart || !dirty || !all.count) return;
    dirty = false;
    const end = all.t[all.count - 1], from = seconds ? end - seconds : all.t[0];
    const [t, y] = all.between(from, end, chart.width);
    chart.setData([t, y.map((v) => (v === null ? null : v * scale))]);
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
