// The control bar and the table of figures over meshcat's viewer. They only steer and read meshcat's
// own animator, so that its panel and the bar always agree. Returns what shows and hides them.
function (viewer, data) {
  const ID = "pepper-drake-player";
  const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 4];
  const previous = document.getElementById(ID);
  if (previous) previous.dispatchEvent(new Event("leave"));

  const animator = viewer.animator;
  const lastFrame = Math.max(...data.runs.map((run) => run.frames)) - 1;
  const duration = lastFrame / data.frameRate;
  let speed = 1;

  // Three.js' world has y up. Both are needed: meshcat's /Cameras path moves the eye only.
  const [eye, target] = [data.view.eye, data.view.target].map(([x, y, z]) => [x, z, -y]);
  viewer.controls.target.set(...target);
  viewer.camera.position.set(...eye);
  viewer.camera.fov = 38;

  const make = (tag, className, parent, text) => {
    const element = document.createElement(tag);
    element.className = className;
    if (text !== undefined) element.textContent = text;
    parent.appendChild(element);
    return element;
  };

  const root = make("div", "", document.body);
  root.id = ID;
  make("style", "", root, `
    #${ID} { font: 13px/1.45 system-ui, sans-serif; color: #1d2730; }
    #${ID} .card { position: fixed; background: rgba(255, 255, 255, 0.9); border-radius: 8px;
      box-shadow: 0 1px 6px rgba(20, 30, 40, 0.22); }
    #${ID} .table { top: 12px; left: 12px; padding: 8px 12px; max-height: calc(100vh - 110px);
      max-width: calc(100vw - 24px); overflow: auto; }
    #${ID} table { border-collapse: collapse; }
    #${ID} th { text-align: left; font-weight: 600; padding: 0 0 2px 18px; white-space: nowrap; }
    #${ID} td { text-align: right; padding: 0 0 0 18px; white-space: nowrap;
      font-variant-numeric: tabular-nums; }
    #${ID} td:first-child { text-align: left; padding-left: 0; color: #5a6772; }
    #${ID} tr.rule td { border-top: 1px solid #d5dbe0; }
    #${ID} .chip { display: inline-block; width: 10px; height: 10px; border-radius: 5px;
      margin-right: 6px; }
    #${ID} .bar { left: 12px; right: 12px; bottom: 12px; padding: 6px 12px; display: flex;
      align-items: center; gap: 6px; }
    #${ID} button { border: 0; background: none; font: inherit; color: inherit; min-width: 32px;
      height: 30px; border-radius: 6px; cursor: pointer; }
    #${ID} button:hover { background: #e4e9ee; }
    #${ID} select { font: inherit; border: 1px solid #c9d1d8; border-radius: 6px; height: 28px;
      background: white; }
    #${ID} .time { min-width: 104px; text-align: right; font-variant-numeric: tabular-nums; }
    #${ID} .track { position: relative; flex: 1; height: 30px; }
    #${ID} .track input { position: absolute; inset: 0; width: 100%; margin: 0; }
    #${ID} .stage { position: absolute; top: 22px; height: 4px; border-radius: 2px; opacity: 0.85; }
    @media (max-width: 640px) { #${ID} .track { min-width: 60px; } #${ID} .time { min-width: 0; } }
  `);

  // The table: a column for each run, what is so now, then what it came to.
  const card = make("div", "card table", root);
  const table = make("table", "", card);
  const head = make("tr", "", table);
  make("td", "", head);
  for (const run of data.runs) {
    const cell = make("th", "", head);
    make("span", "chip", cell).style.background = run.color;
    make("span", "", cell, run.name);
  }
  const addRow = (name, texts, className) => {
    const row = make("tr", className, table);
    make("td", "", row, name);
    return texts.map((text) => make("td", "", row, text));
  };
  const names = (key) => [...new Set(data.runs.flatMap((run) => Object.keys(run[key])))];
  const blank = data.runs.map(() => "");
  const stageCells = data.runs.some((run) => run.stages.length) ? addRow("now", blank, "rule") : [];
  const signalCells = names("signals").map((name) => [name, addRow(name, blank, "")]);
  names("figures").forEach((name, k) =>
    addRow(name, data.runs.map((run) => run.figures[name] || ""), k ? "" : "rule"));

  // The bar.
  const bar = make("div", "card bar", root);
  const button = (text, title, action) => {
    const element = make("button", "", bar, text);
    element.title = title;
    element.onclick = () => { action(); element.blur(); };
    return element;
  };
  const now = () => Math.min(animator.time, duration);
  const seek = (time) => {
    const within = Math.min(Math.max(time, 0), duration);
    animator.seek(within);
    animator.display_progress(within);
  };
  const pause = () => { if (animator.playing) animator.pause(); };
  const play = () => {
    if (now() >= duration - 1e-3) seek(0);
    animator.mixer.timeScale = speed;
    animator.play();
  };
  const toggle = () => (animator.playing ? pause() : play());
  const step = (count) => {
    pause();
    seek((Math.round(now() * data.frameRate) + count) / data.frameRate);
  };
  const faster = (by) => {
    speed = SPEEDS[Math.min(Math.max(SPEEDS.indexOf(speed) + by, 0), SPEEDS.length - 1)];
    speeds.value = speed;
    animator.mixer.timeScale = speed;
  };
  button("\u2758\u25C0", "to the start (Home)", () => { pause(); seek(0); });
  button("\u25C2\u2758", "one frame back (left arrow)", () => step(-1));
  const playButton = button("\u25B6", "play or pause (space)", toggle);
  button("\u2758\u25B8", "one frame on (right arrow)", () => step(1));
  const track = make("div", "track", bar);
  const slider = make("input", "", track);
  Object.assign(slider, { type: "range", min: 0, max: lastFrame, step: 1, value: 0 });
  slider.title = "time";
  slider.oninput = () => { pause(); seek(Number(slider.value) / data.frameRate); };
  slider.onchange = () => slider.blur();
  const SHADES = ["#7fb2e0", "#e8b45a", "#b59ad6", "#67b57c", "#3c9457", "#3c9457", "#d0605e"];
  const stages = data.runs[0].stages;
  stages.forEach(([begin, name, shade], k) => {
    const end = k + 1 < stages.length ? stages[k + 1][0] : data.runs[0].frames - 1;
    const mark = make("div", "stage", track);
    mark.style.left = `${(100 * begin) / lastFrame}%`;
    mark.style.width = `${(100 * (end - begin)) / lastFrame}%`;
    mark.style.background = SHADES[shade % SHADES.length];
    mark.title = name;
  });
  const clock = make("span", "time", bar);
  const speeds = make("select", "", bar);
  speeds.title = "speed (- and +)";
  for (const value of SPEEDS) make("option", "", speeds, `${value}\u00D7`).value = value;
  speeds.value = speed;
  speeds.onchange = () => {
    speed = Number(speeds.value);
    animator.mixer.timeScale = speed;
    speeds.blur();
  };

  const KEYS = {
    " ": toggle, ArrowLeft: () => step(-1), ArrowRight: () => step(1),
    Home: () => { pause(); seek(0); }, End: () => { pause(); seek(duration); },
    "-": () => faster(-1), "+": () => faster(1),
  };
  const onKey = (event) => {
    if (event.target.tagName === "INPUT" && event.target.type !== "range") return;
    const action = KEYS[event.key];
    if (action) { event.preventDefault(); action(); }
  };
  window.addEventListener("keydown", onKey);

  let alive = true;
  root.addEventListener("leave", () => {
    alive = false;
    window.removeEventListener("keydown", onKey);
    root.remove();
  });
  const refresh = () => {
    if (!alive) return;
    const frame = Math.round(now() * data.frameRate);
    playButton.textContent = animator.playing ? "\u275A\u275A" : "\u25B6";
    if (document.activeElement !== slider) slider.value = frame;
    clock.textContent = `${now().toFixed(2)} / ${duration.toFixed(2)} s`;
    stageCells.forEach((cell, k) => {
      const run = data.runs[k];
      cell.textContent = run.stages.filter(([begin]) => begin <= frame).map((s) => s[1]).pop() || "";
    });
    for (const [name, cells] of signalCells) {
      cells.forEach((cell, k) => {
        const signal = data.runs[k].signals[name];
        if (!signal) return;
        const value = signal.values[Math.min(frame, signal.values.length - 1)];
        cell.textContent = `${value.toFixed(signal.unit === "mm" ? 1 : 2)} ${signal.unit}`;
      });
    }
    requestAnimationFrame(refresh);
  };
  refresh();
  viewer.gui.close();
  return () => { root.style.display = root.style.display ? "" : "none"; };
}
