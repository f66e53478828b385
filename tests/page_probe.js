// Moves what a person would move and writes what followed into the page, for the tests.
(() => {
  const told = { violations: [], errors: [], requests: [], steps: {} };
  addEventListener("securitypolicyviolation", (event) => told.violations.push(event.blockedURI + " " + event.violatedDirective));
  addEventListener("error", (event) => told.errors.push(String(event.message)));
  const $ = (id) => document.getElementById(id);
  const text = (id) => ($(id) ? $(id).textContent : null);
  const set = (id, value) => { $(id).value = value; $(id).dispatchEvent(new Event("input", { bubbles: true })); };
  const picture = (id) => { const all = $(id).toDataURL(); let sum = 7; for (const c of all) sum = (31 * sum + c.charCodeAt(0)) % 1000000007; return sum; };
  const line = () => document.querySelector("#motion-plot").layout.shapes[0].x0;

  function organ() {
    if (!$("organ-left-plot")) return { absent: text("organ") };
    const found = { first: [picture("organ-left-plot"), picture("organ-right-plot")] };
    document.querySelector("[data-turn]").click();
    found.turned = [picture("organ-left-plot"), picture("organ-right-plot")];
    $("organ-left-plot").dispatchEvent(new KeyboardEvent("keydown", { key: "ArrowLeft" }));
    found.keyed = picture("organ-left-plot");
    set("organ-view", "difference");
    found.difference = { picture: picture("organ-right-plot"), title: text("organ-right-title"), end: text("organ-right-end") };
    set("organ-time", $("organ-time").max);
    found.end = { table: text("organ-table"), note: text("organ-note"), picture: picture("organ-right-plot"), cursor: line(), other: $("time").value };
    set("organ-time", 5);
    found.middle = { table: text("organ-table"), picture: picture("organ-right-plot") };
    set("organ-time", 10);
    return found;
  }

  function motion() {
    const found = { before: line() };
    const before = picture("organ-left-plot");
    set("time", 5);
    found.after = line();
    found.table = text("motion-table");
    found.phase = document.querySelector("#motion-plot").data.filter((t) => t.name === "cursor").map((t) => [t.x[0], t.y[0]]);
    found.organMoved = before !== picture("organ-left-plot");
    return found;
  }

  function fuzzy() {
    if (!$("reading-0")) return { absent: text("fuzzy") };
    const before = text("fuzzy-table"), shape = () => document.querySelector("#sets-plot").layout.shapes[0].x0;
    const found = { before, at: shape() };
    set("reading-0", 31.25);
    set("reading-1", 12.5);
    return { ...found, after: text("fuzzy-table"), moved: shape(), marker: document.querySelector("#surface-plot").data[1].x[0] };
  }

  function similarity() {
    const before = text("similar-table");
    set("similar-at", [...$("similar-at").options].at(-1).value);
    return { before, after: text("similar-table") };
  }

  function theme() {
    const paper = () => getComputedStyle(document.body).backgroundColor, before = paper();
    $("theme").click();
    return { before, after: paper(), plot: document.querySelector("#motion-plot").layout.paper_bgcolor };
  }

  const wait = setInterval(() => {
    if (document.documentElement.dataset.ready !== "yes") return;
    clearInterval(wait);
    setTimeout(move, 500);  // what is refused is told a little later
  }, 50);

  function move() {
    for (const step of [organ, fuzzy, similarity, theme]) {
      try { told.steps[step.name] = step(); } catch (error) { told.errors.push(`${step.name}: ${error}`); }
    }
    if ($("organ-left-plot")) try { told.steps.motion = motion(); } catch (error) { told.errors.push(`motion: ${error}`); }
    told.grid = window.probeReadings && window.probeReadings.map(([system, x, y]) => window.liverStudy.estimate(system, x, y));
    told.requests = performance.getEntriesByType("resource").map((one) => one.name);
    const made = document.createElement("pre");
    made.id = "told";
    made.textContent = JSON.stringify(told);
    document.body.append(made);
  }
})();
