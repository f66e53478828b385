"use strict";
// The page's own program: it draws what the run left, and computes nothing but interpolation.
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const $ = (id) => document.getElementById(id);
  const dark = () => document.documentElement.dataset.theme === "dark";
  // No mode bar: it would overprint legends, and cannot be reached by keyboard.
  const CONFIG = { displayModeBar: false, responsive: true, showSendToCloud: false, plotlyServerURL: "" };
  const SEQUENTIAL = data.scale.map((colour, k) => [k / (data.scale.length - 1), colour]), SET_LOOKS = ["solid", "dash", "dot", "dashdot", "longdash"];

  // --- arrays ------------------------------------------------------------------------------

  /** Flat typed array of a packed one. */
  function flat(packed) {
    const bytes = Uint8Array.from(atob(packed.base64), (c) => c.charCodeAt(0));
    const kinds = { "<i4": Int32Array, "<i2": Int16Array, "<f4": Float32Array };
    return new kinds[packed.kind](bytes.buffer);
  }

  /** Rows of a packed array of two dimensions. */
  function rows(packed) {
    const all = flat(packed), width = packed.shape[1];
    return Array.from({ length: packed.shape[0] }, (_, i) => all.subarray(i * width, (i + 1) * width));
  }

  /** Every third number of a flat array of vectors. */
  function component(all, d, from, count) {
    return Float32Array.from({ length: count }, (_, i) => all[from + 3 * i + d]);
  }

  // --- elements ----------------------------------------------------------------------------

  function options(select, names, values) {
    select.replaceChildren(...names.map((name, i) => new Option(name, values ? values[i] : name)));
  }

  /** Fill a table: header cells, then rows whose first cell names them. */
  function fill(table, caption, head, body) {
    const cell = (tag, content, scope) => {
      const made = document.createElement(tag);
      if (scope) made.scope = scope;
      if (content instanceof Node) made.append(content); else made.textContent = content;
      return made;
    };
    const title = document.createElement("caption");
    title.textContent = caption;
    const top = document.createElement("thead"), rest = document.createElement("tbody");
    const line = document.createElement("tr");
    line.append(...head.map((name) => cell("th", name, "col")));
    top.append(line);
    rest.append(...body.map((one) => {
      const made = document.createElement("tr");
      made.append(...one.map((content, i) => cell(i ? "td" : "th", content, i ? "" : "row")));
      return made;
    }));
    table.replaceChildren(title, top, rest);
  }

  function absent(section, why) {
    const told = document.createElement("p");
    told.className = "none";
    told.textContent = why;
    section.querySelector(".body").replaceChildren(told);
  }

  // --- colours -----------------------------------------------------------------------------

  const variable = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

  /** A colour that can be seen on the paper of the theme. */
  function seen(colour) {
    const parts = [1, 3, 5].map((at) => parseInt(colour.slice(at, at + 2), 16));
    const light = (0.2126 * parts[0] + 0.7152 * parts[1] + 0.0722 * parts[2]) / 255;
    if (!dark() || light > 0.35) return colour;
    const share = light < 0.05 ? 0.92 : 0.5;
    return `rgb(${parts.map((p) => Math.round(p + share * (255 - p))).join(",")})`;
  }

  function layout(more) {
    const ink = variable("--ink"), line = variable("--line"), paper = variable("--paper");
    const base = { paper_bgcolor: paper, plot_bgcolor: paper, font: { color: ink, size: 13 },
      margin: { l: 60, r: 15, t: 30, b: 50 }, showlegend: true,
      legend: { orientation: "h", y: 1.02, yanchor: "bottom" } };
    const axis = { gridcolor: line, linecolor: line, zerolinecolor: line };
    for (const key of Object.keys(more)) if (/^[xy]axis/.test(key)) more[key] = { ...axis, ...more[key] };
    return { ...base, ...more };
  }

  const models = new Map(data.models.map((one) => [one.name, one]));
  const label = (name) => models.get(name).label;

  // --- motion ------------------------------------------------------------------------------

  const motion = new Map(data.probes.map((probe) => [probe.name, probe.lines.map((line) => ({
    model: line.model, decimals: line.decimals, rows: rows(line.motion),
    bounds: line.lower && [rows(line.lower), rows(line.upper)] }))]));
  const longest = [...motion.values()].flat().reduce(
    (best, one) => (one.rows[0].length > best.length ? one.rows[0] : best), new Float32Array(0));
  /** Sample at which the first model of the tool's control point is farthest. */
  function farthest() {
    const [first] = motion.get(data.tool_probe) || [];
    if (!first) return 0;
    return first.rows[1].reduce((best, u, k, all) => (Math.abs(u) > Math.abs(all[best]) ? k : best), 0);
  }

  // As in page.css: panels side by side would be overprinted by each other's titles.
  const NARROW = matchMedia("(max-width: 50rem)");
  const PANELS = [["x", "y", 0, 1], ["x2", "y2", 0, 2], ["x3", "y3", 1, 2]];
  const state = { probe: data.tool_probe, sample: farthest(), playing: 0 };

  function curve(one, [x, y, i, j], first) {
    const model = models.get(one.model);
    return { x: one.rows[i], y: one.rows[j], xaxis: x, yaxis: y, name: model.label, mode: "lines",
      legendgroup: one.model, showlegend: first, hoverinfo: first ? "x+y+name" : "all",
      line: { color: seen(model.colour), dash: model.dash, width: 2 } };
  }

  function band(one, [x, y, , j]) {
    const [low, high] = one.bounds;
    const line = { width: 0 }, common = { xaxis: x, yaxis: y, mode: "lines", line,
      showlegend: false, hoverinfo: "skip", legendgroup: one.model };
    const colour = models.get(one.model).colour + "38";
    return [{ ...common, x: low[0], y: low[j] },
      { ...common, x: high[0], y: high[j], fill: "tonexty", fillcolor: colour }];
  }

  /** A mark at the slider's time on every curve, and a cross where one ends early. */
  function marks(found, [x, y, i, j]) {
    const at = (one) => Math.min(state.sample, one.rows[0].length - 1);
    const lost = (one) => models.get(one.model).status === "diverged" && state.sample >= one.rows[0].length - 1;
    return { x: found.map((one) => one.rows[i][at(one)]), y: found.map((one) => one.rows[j][at(one)]),
      xaxis: x, yaxis: y, mode: "markers", showlegend: false, hoverinfo: "skip", name: "cursor",
      marker: { size: 9, color: found.map((one) => seen(models.get(one.model).colour)),
        symbol: found.map((one) => (lost(one) ? "x" : "circle")),
        line: { color: variable("--paper"), width: 1 } } };
  }

  function drawMotion() {
    const found = motion.get(state.probe) || [];
    const traces = PANELS.flatMap((panel, k) => [
      ...found.filter((one) => one.bounds && k < 2).flatMap((one) => band(one, panel)),
      ...found.map((one) => curve(one, panel, k === 0)), marks(found, panel)]);
    const time = longest[state.sample];
    const line = (x) => ({ type: "line", xref: x, yref: `${x.replace("x", "y")} domain`, x0: time,
      x1: time, y0: 0, y1: 1, line: { color: variable("--quiet"), width: 1, dash: "dot" } });
    const grid = NARROW.matches ? { rows: 3, columns: 1, ygap: 0.3 } : { rows: 1, columns: 3, xgap: 0.18 };
    Plotly.react("motion-plot", traces, layout({
      grid: { ...grid, pattern: "independent" }, shapes: [line("x"), line("x2")],
      xaxis: { title: { text: "time [s]" } }, yaxis: { title: { text: "displacement [mm]" }, ...limits(found, 1) },
      xaxis2: { title: { text: "time [s]" } }, yaxis2: { title: { text: "velocity [mm/s]" }, ...limits(found, 2) },
      xaxis3: { title: { text: "displacement [mm]" }, ...limits(found, 1) },
      yaxis3: { title: { text: "velocity [mm/s]" }, ...limits(found, 2) } }), CONFIG);
    $("motion-plot").setAttribute("aria-label", `Displacement, velocity and phase plane at ${state.probe}`);
    tellMotion(found, time);
  }

  /** Range by the models that finished: one that diverged must not flatten the others. */
  function limits(found, i) {
    const finished = found.filter((one) => models.get(one.model).status === "finished");
    const of = finished.length ? finished : found, all = (least) => of.flatMap(({ rows: own, bounds }) =>
      [own, ...(bounds || [])].map((one) => one[i].reduce((a, b) => (least ? Math.min(a, b) : Math.max(a, b)))));
    const low = Math.min(...all(true)), high = Math.max(...all(false)), room = 0.06 * (high - low || 1);
    return { range: [low - room, high + room] };
  }

  /** Decimals [mm] that the errors of some models' curves at the tool leave. */
  function decimals(names) {
    const found = (motion.get(data.tool_probe) || []).filter((one) => names.includes(one.model));
    return Math.min(6, ...found.map((one) => one.decimals[0]));
  }

  /** A number with so many decimals, and no sign where they are all nought. */
  function fixed(x, decimals) {
    const text = x.toFixed(decimals);
    return Number(text) === 0 ? text.replace("-", "") : text;
  }

  function tellMotion(found, time) {
    const told = time === undefined ? "" : `${time.toFixed(3)} s`;
    $("time-out").value = told;
    $("time").setAttribute("aria-valuetext", told);
    fill($("motion-table"), `At ${state.probe}, at the time of the slider`,
      ["model", "displacement [mm]", "velocity [mm/s]", "largest displacement [mm]"],
      found.map((one) => {
        const over = state.sample >= one.rows[0].length;
        const now = over ? ["ended", "ended"] : [1, 2].map((i) => fixed(one.rows[i][state.sample], one.decimals[i - 1]));
        const peak = one.rows[1].reduce((most, u) => Math.max(most, Math.abs(u)), 0);
        return [label(one.model), ...now, fixed(peak, one.decimals[0])];
      }));
  }

  function goTo(sample) {
    state.sample = Math.max(0, Math.min(sample, longest.length - 1));
    for (const id of ["time", "organ-time"]) if ($(id)) $(id).value = state.sample;
    if (document.documentElement.dataset.ready === "yes") drawMotion();
    if (organ && organ.views) drawOrgan();
  }

  function play() {
    const on = !state.playing;
    for (const id of ["play", "organ-play"]) if ($(id)) {
      $(id).textContent = on ? "pause" : "play";
      $(id).setAttribute("aria-pressed", String(on));
    }
    clearInterval(state.playing);
    const stride = Math.max(1, Math.round(longest.length / 100));
    state.playing = on ? setInterval(() => goTo((state.sample + stride) % longest.length), 100) : 0;
  }

  function startMotion() {
    if (!longest.length) { absent($("motion"), "No model has a finite sample."); return; }
    options($("probe"), data.probes.map((one) => one.name));
    $("probe").value = state.probe;
    $("time").max = longest.length - 1;
    $("time").value = state.sample;
    $("probe").addEventListener("input", (e) => { state.probe = e.target.value; drawMotion(); });
    $("time").addEventListener("input", (e) => goTo(Number(e.target.value)));
    $("play").addEventListener("click", play);
    NARROW.addEventListener("change", drawMotion);
    drawMotion();
  }

  // --- organ -------------------------------------------------------------------------------

  const organ = data.organ && {
    points: flat(data.organ.points), triangles: flat(data.organ.triangles), probes: flat(data.organ.probes),
    films: new Map(Object.entries(data.organ.films).map(([name, one]) => [name, { all: flat(one.values), unit: one.unit, frames: one.values.shape[0] }])),
    held: flat(data.organ.held), loaded: flat(data.organ.loaded), ways: flat(data.organ.ways), most: new Map(),
    count: data.organ.points.shape[0] };
  const SIDES = ["left", "right"], KEYS = { ArrowLeft: [-10, 0], ArrowRight: [10, 0], ArrowUp: [0, 10], ArrowDown: [0, -10] };
  const INK = [0.84, 0.37, 0.0], RED = [0.8, 0.0, 0.0], BLUE = [0.0, 0.45, 0.7];
  // Seen from where the tool pushes, from a little above and aside.
  const eye = data.organ && { around: Math.atan2(-data.organ.push[1], -data.organ.push[0]) + 0.35,
    above: Math.max(-1.2, Math.min(1.2, Math.asin(-data.organ.push[2]) + 0.3)), zoom: 1 };

  const chosen = (side) => $(`organ-${side}`).value;
  const factor = () => 10 ** Number($("organ-factor").value);
  const largest = (values) => values.reduce((most, x) => Math.max(most, x), 0);

  /** Displacement [mm] of every vertex at a sample, linear between the frames that are kept; null once a model is lost. */
  function displacement(name, sample = state.sample) {
    const { all, unit, frames } = organ.films.get(name), samples = data.organ.samples, size = 3 * organ.count;
    let k = 0;
    while (k + 1 < samples.length && samples[k + 1] <= sample) k += 1;
    const share = samples[k] === sample ? 0 : (sample - samples[k]) / (samples[k + 1] - samples[k]);
    if (k + (share > 0 ? 1 : 0) >= frames) return null;
    const next = share > 0 ? size : 0;
    return Float32Array.from({ length: size }, (_, i) => unit * ((1 - share) * all[k * size + i] + share * all[k * size + next + i]));
  }

  /** Largest length [mm] over all frames of a model, or of its difference from another. */
  function most(name, against) {
    const key = `${name} ${against || ""}`;
    if (!organ.most.has(key)) organ.most.set(key, data.organ.samples.reduce((found, sample) => {
      const u = displacement(name, sample), v = against && displacement(against, sample);
      return u && (v || !against) ? Math.max(found, largest(lengths(u, v))) : found;
    }, 0));
    return organ.most.get(key);
  }

  /** Middles of facets, by their numbers, where the surface is. */
  function middles(facets, places) {
    return Array.from(facets, (t) => [0, 1, 2].map((d) => [0, 1, 2].reduce((sum, c) => sum + places[3 * organ.triangles[3 * t + c] + d], 0) / 3)).flat();
  }

  /** Length of a displacement, or of its difference from another, at every vertex [mm]. */
  function lengths(u, v) {
    return Float32Array.from({ length: organ.count }, (_, i) =>
      Math.hypot(...[0, 1, 2].map((d) => u[3 * i + d] - (v ? v[3 * i + d] : 0))));
  }

  /** The box of the organ: its centre and half of its largest extent [mm], with room. */
  function box() {
    const ends = [0, 1, 2].map((d) => {
      let [low, high] = [Infinity, -Infinity];
      for (let k = d; k < organ.points.length; k += 3) { low = Math.min(low, organ.points[k]); high = Math.max(high, organ.points[k]); }
      return [low, high];
    });
    return { centre: ends.map(([a, b]) => 0.5 * (a + b)), half: 0.62 * Math.max(...ends.map(([a, b]) => b - a)) };
  }

  /** Zoom at which the whole organ, as it is seen at first, fills a canvas. */
  function fitting({ centre, half }, { width, height }) {
    const { right, up } = organView.axes(eye), reach = [right, up].map((axis) => {
      let most = 0;
      for (let k = 0; k < organ.points.length; k += 3)
        most = Math.max(most, Math.abs(axis.reduce((sum, a, d) => sum + a * (organ.points[k + d] - centre[d]), 0)));
      return most || 1;
    });
    return 0.85 * half * Math.min(width / height / reach[0], 1 / reach[1]);
  }

  /** The control points where their curves have them at the slider's time, along the push. */
  function probesOf(name) {
    const push = data.organ.push;
    return data.probes.map((probe, p) => {
      const line = (motion.get(probe.name) || []).find((one) => one.model === name);
      const u = line ? line.rows[1][Math.min(state.sample, line.rows[0].length - 1)] : 0;
      return [0, 1, 2].map((d) => organ.probes[3 * p + d] + factor() * u * push[d]);
    });
  }

  /** What both sides show: numbers per vertex [mm], and the end of each colour scale. */
  function shown() {
    const of = data.organ.reference, [u, v] = SIDES.map((side) => displacement(chosen(side)));
    const against = $("organ-view").value === "difference" && of ? displacement(of) : null;
    const values = [lengths(u), lengths(v, against)], ends = [most(chosen("left")), most(chosen("right"), against && of)];
    const common = Math.max(ends[0], Math.min(ends[1], 3 * ends[0]));
    return { values, limits: (against ? ends : [common, common]).map((x) => x || 1), against: against && of };
  }

  function drawOrgan() {
    const lost = SIDES.map(chosen).filter((name) => displacement(name) === null).map(label);
    if (lost.length) { tellOrgan(`${[...new Set(lost)].join(" and ")} diverged before this time: no surface to show.`); return; }
    const { values, limits, against } = shown(), push = data.organ.push, { half } = organ.box;
    SIDES.forEach((side, k) => {
      const name = chosen(side), u = displacement(name), view = organ.views[k];
      const tip = probesOf(name)[data.probes.findIndex((one) => one.name === data.tool_probe)] || data.organ.tool;
      const places = organ.points.map((x, i) => x + factor() * u[i]);
      const marks = [{ places: middles(organ.held, places), colour: BLUE, size: 4, kind: "on" },
        { places: middles(organ.loaded, places), colour: RED, size: 4, kind: "on" },
        { places: [...tip.map((x, d) => x - 0.45 * half * push[d]), ...tip], colour: RED, size: 1, kind: "line" },
        { places: [...organ.ways], colour: RED, size: 1, kind: "line" },
        { places: probesOf(name).flat(), colour: INK, size: 9 }];
      view.values = values[k];
      view.draw({ places, shares: values[k].map((x) => x / limits[k]), marks },
        eye, paper());
      const what = k === 1 && against ? `${label(name)} − ${label(against)}` : label(name);
      $(`organ-${side}-title`).textContent = what;
      $(`organ-${side}-plot`).setAttribute("aria-label", `Deformed organ: ${what}, up to ${largest(values[k]).toPrecision(3)} mm`);
      $(`organ-${side}-end`).textContent = `${limits[k].toPrecision(3)} mm${largest(values[k]) > limits[k] * (1 + 1e-6) ? " and more" : ""}`;
      nameProbes(side, view, probesOf(name));
    });
    tellOrgan("");
    tableOrgan();
  }

  const paper = () => [1, 3, 5].map((i) => parseInt(variable("--paper").slice(i, i + 2), 16) / 255);

  function nameProbes(side, view, places) {
    $(`organ-${side}-names`).replaceChildren(...places.map((place, p) => {
      const [x, y] = view.project(place), made = document.createElement("span");
      made.textContent = data.probes[p].name;
      made.style.transform = `translate(${x + 7}px, ${y - 20}px)`;
      return made;
    }));
  }

  function tellOrgan(why) {
    const time = longest[state.sample];
    const at = Number.isFinite(time) ? ` Control points (orange) are at the position of their curves at ${time.toFixed(3)} s, along the push (red line).` : "";
    $("organ-note").textContent = `${why} The surface is stored at ${data.organ.samples.length} times and interpolated linearly in between. Blue dots: supports, red dots: where the surface is loaded${organ.ways.length ? "; dashed: path of the tool, on the organ at rest" : ""}. Displacements are exaggerated ${factor().toPrecision(3)} times.${at} Drag, or use the buttons or the arrow keys, to rotate both; point at the surface to read its value.`.trim();
    $("organ-factor-out").value = `× ${factor().toPrecision(3)}`;
    $("organ-time-out").value = Number.isFinite(time) ? `${time.toFixed(3)} s` : "";
  }

  function tableOrgan() {
    const of = data.organ.reference, against = of && displacement(of);
    const body = [...organ.films.keys()].filter((name) => displacement(name)).map((name) => {
      const u = displacement(name);
      const off = against && name !== of ? largest(lengths(u, against)).toFixed(decimals([name, of])) : "–";
      return [label(name), largest(lengths(u)).toFixed(decimals([name])), off];
    });
    fill($("organ-table"), `At the vertices of the surface, which need not include the control points, at ${(longest[state.sample] || 0).toFixed(3)} s`, ["model", "largest displacement [mm]",
      of ? `largest difference from ${label(of)} [mm]` : "difference"], body);
  }

  function turn(around, upwards) {
    eye.around += around * Math.PI / 180;
    eye.above = Math.max(-1.5, Math.min(1.5, eye.above + upwards * Math.PI / 180));
    drawOrgan();
  }

  function zoom(by) {
    eye.zoom = Math.max(0.3, Math.min(8, eye.zoom * by));
    drawOrgan();
  }

  /** Let a pointer turn both sides, and read the value under it. */
  function listen(side, view) {
    const canvas = $(`organ-${side}-plot`);
    let from = null;
    canvas.addEventListener("pointerdown", (event) => { from = [event.clientX, event.clientY]; canvas.setPointerCapture(event.pointerId); });
    canvas.addEventListener("pointerup", () => { from = null; });
    canvas.addEventListener("pointermove", (event) => {
      if (from) {
        turn(-0.4 * (event.clientX - from[0]), 0.4 * (event.clientY - from[1]));
        from = [event.clientX, event.clientY];
        return;
      }
      const vertex = view.nearest(event.offsetX, event.offsetY);
      $(`organ-${side}-read`).textContent = vertex < 0 ? "" : `here ${view.values[vertex].toPrecision(3)} mm`;
    });
    canvas.addEventListener("keydown", (event) => {
      if (KEYS[event.key]) { event.preventDefault(); turn(...KEYS[event.key]); }
      if (event.key === "+" || event.key === "-") zoom(event.key === "+" ? 1.25 : 0.8);
    });
  }

  function startOrgan() {
    if (!organ) { absent($("organ"), "There is no surface to show: the scene is a single control point, or no model reached the peak load."); return; }
    organ.box = box();
    organ.views = SIDES.map((side) => organView.make($(`organ-${side}-plot`), organ.triangles, data.scale, organ.box.centre, organ.box.half));
    if (organ.views.includes(null)) { absent($("organ"), "This browser does not support WebGL 2, which is needed to draw the organ."); organ.views = null; return; }
    const names = [...organ.films.keys()], of = data.organ.reference;
    for (const side of SIDES) {
      options($(`organ-${side}`), names.map(label), names);
      $(`organ-${side}-bar`).style.background = `linear-gradient(to right, ${data.scale.join(",")})`;
      listen(side, organ.views[SIDES.indexOf(side)]);
    }
    $("organ-left").value = of || names[0];
    $("organ-right").value = names.includes(data.nearest) ? data.nearest : names[names.length - 1];
    Object.assign($("organ-time"), { max: Math.max(0, longest.length - 1), value: state.sample });
    $("organ-time").addEventListener("input", (e) => goTo(Number(e.target.value)));
    $("organ-play").addEventListener("click", play);
    Object.assign($("organ-factor"), { max: Math.log10(data.organ.factor) + 0.5, step: "any" });
    $("organ-factor").value = Math.log10(data.organ.factor);
    $("organ-view").disabled = !of;
    eye.zoom = fitting(organ.box, $("organ-left-plot").getBoundingClientRect());
    for (const id of ["organ-left", "organ-right", "organ-view", "organ-factor"]) $(id).addEventListener("input", drawOrgan);
    document.querySelectorAll("[data-turn]").forEach((button) =>
      button.addEventListener("click", () => turn(...button.dataset.turn.split(",").map(Number))));
    document.querySelectorAll("[data-zoom]").forEach((button) =>
      button.addEventListener("click", () => zoom(Number(button.dataset.zoom))));
    window.addEventListener("resize", drawOrgan);
    drawOrgan();
  }

  // --- similarity --------------------------------------------------------------------------

  function score(cell) {
    const made = document.createElement("span");
    if (!cell) { made.textContent = "–"; return made; }
    made.textContent = cell.printed;
    if (cell.interval) {
      const small = document.createElement("small");
      small.textContent = cell.interval;
      made.append(small);
    }
    return made;
  }

  function drawSimilarity() {
    const found = data.matrices.find((one) => one.reference === $("similar-to").value && one.probe === $("similar-at").value);
    const table = $("similar-table");
    if (!found) { table.replaceChildren(); return; }
    fill(table, `Scores against ${found.reference} at ${found.probe}`, ["model", ...data.measures],
      found.cells.map((cells, i) => [found.models[i], ...cells.map(score)]));
    table.querySelectorAll("tbody tr").forEach((line, i) => line.querySelectorAll("td").forEach((cell, j) => {
      const one = found.cells[i][j];
      if (one) cell.style.background = `rgba(${variable("--score")}, ${(0.45 * Math.max(0, Math.min(1, one.score))).toFixed(3)})`;
    }));
  }

  function startSimilarity() {
    if (!data.matrices.length) { absent($("similarity"), "No curves were compared."); return; }
    options($("similar-to"), [...new Set(data.matrices.map((one) => one.reference))]);
    options($("similar-at"), [...new Set(data.matrices.map((one) => one.probe))]);
    $("similar-at").value = data.tool_probe;
    for (const id of ["similar-to", "similar-at"]) $(id).addEventListener("input", drawSimilarity);
    drawSimilarity();
  }

  // --- fuzzy systems -----------------------------------------------------------------------

  const fuzzy = data.fuzzy && { x: flat(data.fuzzy.x), y: flat(data.fuzzy.y),
    grids: new Map(data.fuzzy.surfaces.map((one) => [one.system, rows(one.values)])) };

  /** Place of a reading among the lines of a grid: the line below it, and the share beyond. */
  function between(lines, value) {
    let k = 0;
    while (k < lines.length - 2 && lines[k + 1] <= value) k += 1;
    const share = (value - lines[k]) / (lines[k + 1] - lines[k]);
    return [k, Math.max(0, Math.min(1, share))];
  }

  /** Estimate [kPa] of a system at two readings [kPa], bilinear between the lines of its grid. */
  function estimate(system, first, second) {
    const grid = fuzzy.grids.get(system), [j, s] = between(fuzzy.x, first), [i, t] = between(fuzzy.y, second);
    const mix = (a, b, share) => a + share * (b - a);
    return mix(mix(grid[i][j], grid[i][j + 1], s), mix(grid[i + 1][j], grid[i + 1][j + 1], s), t);
  }

  /** Why the sliders do not give the scene's own estimate, where it lacks one of their readings. */
  function unread() {
    const names = data.fuzzy.unread.map((name) => name.toUpperCase()).join(" and ");
    return names ? ` The scene has no reading of ${names}: its estimate omits it, the sliders include it.` : "";
  }

  const readings = () => [0, 1].map((k) => Number($(`reading-${k}`).value));

  function drawEstimates() {
    const now = readings(), [first, second] = data.fuzzy.inputs.map((name) => name.toUpperCase());
    now.forEach((value, k) => {
      $(`reading-${k}-out`).value = `${value.toFixed(1)} kPa`;
      $(`reading-${k}`).setAttribute("aria-valuetext", `${value.toFixed(1)} kPa`);
    });
    fill($("fuzzy-table"), `Estimated Young's modulus [kPa] at ${first} ${now[0].toFixed(1)} kPa, ${second} ${now[1].toFixed(1)} kPa`,
      ["system", "at the sliders", "error of interpolation", "at the readings of the scene, exact"],
      data.fuzzy.surfaces.map((one) => [one.name, estimate(one.system, ...now).toFixed(2), `± ${one.error.toFixed(2)}`,
        one.estimate === null ? "–" : one.estimate.toFixed(2)]));
    drawSurface();
    drawSets();
  }

  function drawSurface() {
    const one = data.fuzzy.surfaces.find((found) => found.system === $("system").value);
    const [x, y] = readings();
    const axis = (k) => ({ title: { text: `${data.fuzzy.inputs[k].toUpperCase()} [kPa]` } });
    Plotly.react("surface-plot", [
      { type: "contour", x: fuzzy.x, y: fuzzy.y, z: fuzzy.grids.get(one.system), colorscale: SEQUENTIAL, ncontours: 16,
        contours: { showlabels: true }, colorbar: { title: { text: "kPa" }, thickness: 12 }, name: one.name,
        hovertemplate: "%{x:.1f}, %{y:.1f}: %{z:.2f} kPa<extra></extra>" },
      { type: "scatter", mode: "markers", x: [x], y: [y], showlegend: false, hoverinfo: "skip", name: "sliders",
        marker: { size: 13, color: "#D55E00", symbol: "cross", line: { color: "#ffffff", width: 2 } } },
    ], layout({ showlegend: false, xaxis: axis(0), yaxis: axis(1) }), CONFIG);
  }

  function drawSets() {
    const one = data.fuzzy.sets.find((found) => found.name === $("variable").value);
    const x = flat(one.x), [low, mid, high] = [one.lower, one.principal, one.upper].map(rows);
    const colours = ["#0072B2", "#E69F00", "#009E73", "#CC79A7", "#56B4E9", "#D55E00", "#999933"];
    const traces = one.sets.flatMap((name, i) => {
      const colour = seen(colours[i % colours.length]), common = { x, mode: "lines", hoverinfo: "skip", showlegend: false };
      return [{ ...common, y: low[i], line: { width: 0 } },
        { ...common, y: high[i], line: { width: 0 }, fill: "tonexty", fillcolor: colours[i % colours.length] + "38" },
        { ...common, y: mid[i], name, showlegend: true, hoverinfo: "x+y+name",
          line: { color: colour, dash: SET_LOOKS[i % SET_LOOKS.length], width: 2 } }];
    });
    const place = data.fuzzy.inputs.indexOf(one.name), at = one.is_output
      ? data.fuzzy.surfaces.map((s) => estimate(s.system, ...readings())) : place < 0 ? [] : [readings()[place]];
    Plotly.react("sets-plot", traces, layout({
      xaxis: { title: { text: one.is_output ? "Young's modulus [kPa]" : "reading [kPa]" } }, yaxis: { title: { text: "membership" }, range: [0, 1.05] },
      shapes: at.map((value) => ({ type: "line", x0: value, x1: value, y0: 0, y1: 1.05, line: { color: variable("--ink"), width: 1.5, dash: "dot" } })) }), CONFIG);
  }

  function startFuzzy() {
    if (!fuzzy) { absent($("fuzzy"), "This run has no fuzzy systems."); return; }
    [fuzzy.x, fuzzy.y].forEach((lines, k) => {
      const slider = $(`reading-${k}`);
      Object.assign(slider, { min: lines[0], max: lines[lines.length - 1], step: "any" });
      slider.value = data.fuzzy.start[k];
      $(`reading-${k}-name`).textContent = data.fuzzy.inputs[k].toUpperCase();
      slider.addEventListener("input", drawEstimates);
    });
    options($("system"), data.fuzzy.surfaces.map((one) => one.name), data.fuzzy.surfaces.map((one) => one.system));
    options($("variable"), data.fuzzy.sets.map((one) => (one.is_output ? "stiffness (output)" : one.name.toUpperCase())), data.fuzzy.sets.map((one) => one.name));
    $("variable").value = data.fuzzy.inputs[0];
    $("system").addEventListener("input", drawSurface);
    $("variable").addEventListener("input", drawSets);
    $("fuzzy-note").textContent = `Bilinear between ${fuzzy.x.length} × ${fuzzy.y.length} lines of readings that the run evaluated, the other readings as in the scene; a reading below the first line is set to it. The error is that of omitting every second line.${unread()}`;
    drawEstimates();
  }

  // --- trade-off ---------------------------------------------------------------------------

  /** Ticks of a logarithmic axis at 1, 2 and 5 times powers of ten. */
  function ticks(values) {
    const powers = Array.from({ length: 13 }, (_, k) => k - 6), least = Math.min(...values), most = Math.max(...values);
    const at = powers.flatMap((k) => [1, 2, 5].map((x) => Number(`${x}e${k}`))).filter((x) => x >= least / 2 && x <= most * 2);
    return { tickvals: at, ticktext: at.map(String) };
  }

  function drawTradeoff() {
    const all = data.tradeoff.configurations, errors = all.map((one) => one.error ?? one.bar);
    // Fronts last, and so above the others.
    const groups = [["any load", (one) => one.any_load && !one.on_any_load_front, "circle", "#0072B2"],
      ["load known beforehand", (one) => !one.any_load && !one.on_front, "square", "#009E73"],
      ["any load, on its Pareto front", (one) => one.on_any_load_front, "diamond", "#D55E00"],
      ["load known beforehand, on the Pareto front of all", (one) => !one.any_load && one.on_front, "star", "#CC79A7"]];
    const traces = groups.map(([name, is, symbol, colour]) => {
      const found = data.tradeoff.configurations.filter(is);
      return { type: "scatter", mode: "markers", name, x: found.map((one) => one.wall), y: found.map((one) => one.error ?? one.bar),
        text: found.map((one) => `${one.name}<br>error ${one.stated}<br>${one.wall.toPrecision(2)} s per simulated second`),
        hoverinfo: "text", marker: { size: 11, color: seen(colour), symbol: found.map((one) => symbol + (one.error === null ? "-open" : "")), line: { width: 1.5, color: seen(colour) } } };
    });
    Plotly.react("tradeoff-plot", traces, layout({
      xaxis: { type: "log", title: { text: "wall time per simulated second [s/s]" }, ...ticks(all.map((one) => one.wall)) },
      yaxis: { type: "log", title: { text: "error of the field at the peak [%]" }, ...ticks(errors) },
      shapes: [{ type: "line", x0: 1, x1: 1, yref: "paper", y0: 0, y1: 1, line: { color: variable("--quiet"), dash: "dot", width: 1 } }] }), CONFIG);
  }

  function startTradeoff() {
    if (!data.tradeoff.configurations.length) { absent($("tradeoff"), "No trade-off study is stored."); return; }
    $("tradeoff-note").textContent = `${data.tradeoff.conditions} The dotted line is real time. An open mark is an error below that of the reference, drawn at the error of the reference. No configuration is both faster and more accurate than one on a Pareto front.`;
    fill($("tradeoff-table"), "Configurations measured", ["configuration", "error", "wall per simulated second [s/s]", "load", "on a Pareto front"],
      data.tradeoff.configurations.map((one) => [one.name, one.stated, one.wall.toPrecision(2), one.any_load ? "any" : "known beforehand",
        one.on_front ? "of all" : one.on_any_load_front ? "of any load" : "–"]));
    drawTradeoff();
  }

  // --- page --------------------------------------------------------------------------------

  function drawAll() {
    if (longest.length) drawMotion();
    if (organ && organ.views) drawOrgan();
    if (data.matrices.length) drawSimilarity();
    if (fuzzy) drawEstimates();
    if (data.tradeoff.configurations.length) drawTradeoff();
  }

  function wear(theme) {
    document.documentElement.dataset.theme = theme;
    $("theme").textContent = theme === "dark" ? "Light" : "Dark";
    $("theme").setAttribute("aria-pressed", String(theme === "dark"));
  }

  function startPage() {
    const wish = matchMedia("(prefers-color-scheme: dark)");
    wear(wish.matches ? "dark" : "light");
    wish.addEventListener("change", () => { wear(wish.matches ? "dark" : "light"); drawAll(); });
    $("theme").addEventListener("click", () => { wear(dark() ? "light" : "dark"); drawAll(); });
    $("copy").addEventListener("click", copy);
    startOrgan();
    startSimilarity();
    // Plotly takes a while to be read: after the first picture.
    requestAnimationFrame(() => setTimeout(startPlots, 0));
  }

  function startPlots() {
    const plotly = document.createElement("script");
    plotly.textContent = $("plotly").textContent;
    document.head.append(plotly);
    for (const start of [startMotion, startFuzzy, startTradeoff]) start();
    document.documentElement.dataset.ready = "yes";
  }

  /** Copy the scene, also where the clipboard is kept from pages on disk. */
  function copy() {
    const range = document.createRange(), selection = getSelection();
    range.selectNodeContents($("toml"));
    selection.removeAllRanges();
    selection.addRange(range);
    $("copied").textContent = document.execCommand("copy") ? "copied" : "selected: copy it with the keyboard";
  }

  window.liverStudy = { estimate, goTo, state };
  startPage();
})();
