// Starts the viewers of a page, in the order of their fragments.
//
// For programs, window.geodesicOcp.viewers[i] (also `viewer3d` of its section element) has
//   time, range              [s] or path parameter
//   seek(time)               to a time within the range; everything is drawn before it returns
//   play(), pause(), playing
//   speed, loop              may be set
//   layers                   {name: on}
//   setLayer(name, on)
//   reset()                  the first view
//   panes                    of each: element, canvas, camera, controls, named({clientX, clientY})
//   picture(pane)            data URL of a PNG of what a pane shows now

class PlaybackViewer {
  constructor(root) {
    this.root = root;
    const data = JSON.parse(root.querySelector('script[type="application/json"]').textContent);
    this.data = data;
    this.range = data.range;
    [this.time, this.playing, this.speedNow, this.loopNow] = [data.range[0], false, 1, false];
    this.layers = Object.fromEntries(data.layers);
    this.untouched = true;
    this.panes = supported() ? this.makePanes(data) : [];
    root.querySelector(".playback-no-webgl").hidden = supported();
    const panes = root.querySelector(".playback-panes");
    panes.hidden = !supported();
    this.help = help(this.scale());
    root.append(this.help);
    panes.after(this.tools(data));
    if (data.range[1] > data.range[0]) {
      this.bar = new Bar(this, data);
      panes.after(this.bar.element);
    }
    const plots = root.querySelector(".playback-plots");
    this.plots = new Plots(this, plots, data.range);
    for (const [name, on] of data.layers) this.setLayer(name, on);
    this.seek(this.time);
    this.last = performance.now();
    // Nothing is played while the page is hidden.
    document.addEventListener("visibilitychange", () => (this.last = performance.now()));
    requestAnimationFrame((now) => this.step(now));
  }

  makePanes(data) {
    const surfaces = data.bodies.map(surface);
    const panes = data.scenes.map((scene, index) => {
      const element = this.root.querySelectorAll(".playback-view")[index];
      return new Pane(element, scene, data, surfaces);
    });
    const observer = new ResizeObserver(() => this.fit());
    for (const pane of panes) {
      observer.observe(pane.element);
      pane.controls.addEventListener("change", () => {
        if (this.fitting) return;
        this.untouched = false;
        this.moveCameras(() => panes.forEach((other) => other !== pane && other.follow(pane)));
      });
      pane.element.addEventListener("dblclick", () => this.reset());
      this.nameOnRest(pane);
    }
    return panes;
  }

  // The name of what is below a resting pointer.
  nameOnRest(pane) {
    let timer = 0;
    pane.element.addEventListener("pointermove", (event) => {
      clearTimeout(timer);
      pane.element.title = "";
      if (event.buttons || event.pointerType === "touch") return;
      timer = setTimeout(() => (pane.element.title = pane.named(event)), 120);
    });
    pane.element.addEventListener("pointerleave", () => clearTimeout(timer));
  }

  // Panes take the size of their elements; a view that nobody has changed shows everything again.
  fit() {
    for (const pane of this.panes) pane.resize();
    if (this.untouched) {
      const views = this.panes.map((pane) => pane.fit(this.data.azimuth, this.data.elevation));
      const distance = Math.max(...views.map((view) => view.distance));
      this.moveCameras(() => this.panes.forEach((pane, i) => pane.look(views[i], distance)));
    }
    this.draw();
  }

  // Cameras that move on their own tell of it as if someone had moved them.
  moveCameras(move) {
    this.fitting = true;
    move();
    this.fitting = false;
  }

  // A sentence about the size of the floor's squares, where they have one.
  scale() {
    const squares = [...new Set(this.panes.map((pane) => pane.square))];
    const bodies = this.data.scenes.every((scene) => scene.actors.length);
    return squares.length === 1 && bodies ? ` Squares of the floor are ${squares[0]} m wide.` : "";
  }

  // Switches of layers with what their lines look like, and buttons for the view.
  tools(data) {
    const tools = made("div", { class: "playback-tools" });
    this.switches = {};
    for (const name of ["", ...Object.keys(this.layers)]) {
      const entries = legend(data, name);
      if (name) {
        const box = made("input", { type: "checkbox" });
        box.addEventListener("change", () => this.setLayer(name, box.checked));
        this.switches[name] = box;
        if (this.panes.length) tools.append(made("span", {}, made("label", {}, box, name), ...entries));
      } else if (entries.length && this.panes.length) tools.append(made("span", {}, ...entries));
    }
    const view = made("div", { class: "playback-buttons" });
    if (this.panes.length) view.append(button("first view", icon("reset"), () => this.reset()));
    if (document.fullscreenEnabled) {
      view.append(button("full screen", icon("full"), () => this.toggleFull()));
    }
    view.append(button("help", "?", () => this.help.showModal()));
    tools.append(view);
    return tools;
  }

  get speed() {
    return this.speedNow;
  }

  set speed(value) {
    this.speedNow = value;
    this.bar?.showState();
  }

  get loop() {
    return this.loopNow;
  }

  set loop(value) {
    this.loopNow = value;
    this.bar?.showState();
  }

  seek(time) {
    const [start, stop] = this.range;
    this.time = Math.min(stop, Math.max(start, Number(time)));
    for (const pane of this.panes) pane.show(this.time);
    this.bar?.show(this.time);
    this.plots.show(this.time);
    this.draw();
  }

  play() {
    if (this.range[1] <= this.range[0]) return;
    if (this.time >= this.range[1]) this.seek(this.range[0]);
    this.playing = true;
    this.bar.showState();
  }

  pause() {
    this.playing = false;
    this.bar?.showState();
  }

  setLayer(name, on) {
    if (!(name in this.layers)) return;
    this.layers[name] = Boolean(on);
    this.switches[name].checked = this.layers[name];
    for (const pane of this.panes) pane.setLayer(name, this.layers[name]);
    this.draw();
  }

  reset() {
    this.untouched = true;
    this.fit();
  }

  picture(pane = 0) {
    this.panes[pane].render();
    return this.panes[pane].canvas.toDataURL();
  }

  toggleFull() {
    if (document.fullscreenElement) document.exitFullscreen();
    else if (document.fullscreenEnabled) this.root.requestFullscreen();
  }

  draw() {
    for (const pane of this.panes) if (pane.viewer.needs_render && pane.camera) pane.render();
  }

  step(now) {
    const [start, stop] = this.range;
    const passed = Math.max(0, now - this.last) / 1000;
    this.last = now;
    if (this.playing) {
      const rate = this.speed * (this.data.parameter ? (stop - start) / PASS : 1);
      let time = this.time + rate * passed;
      if (time >= stop && this.loop) time = start + ((time - start) % (stop - start));
      else if (time >= stop) this.pause();
      this.seek(time);
    }
    this.draw();
    requestAnimationFrame((next) => this.step(next));
  }
}

// Lines and colours of a layer with their names, as in the plots.
function legend(data, layer) {
  const entries = new Map();
  for (const scene of data.scenes) {
    const shown = [...scene.clouds, ...scene.actors].filter(({ role }) => role);
    const named = [...scene.trails, ...shown];
    for (const { name, role, layer: own, points } of named) {
      if (own === layer) entries.set(`${role} ${name}`, [name, role, points !== undefined]);
    }
  }
  const kinds = [["solids", OBSTACLE], ["ellipsoids", BALL], ["clouds", MARKER]].filter(([kind]) =>
    data.scenes.some((scene) => scene[kind].some((item) => item.layer === layer && !item.role))
  );
  const patches = kinds.map(([, paint]) => {
    const swatch = made("i", { class: "playback-patch" });
    swatch.style.background = paint;
    return made("span", { class: "playback-entry" }, swatch);
  });
  const lines = [...entries.values()].map(([name, role, line]) => {
    const { colour: paint, dash } = data.roles[role];
    const swatch = made("i");
    if (line && dash) {
      const [on, off] = dash.map((each) => 3 * each);
      swatch.style.background = `repeating-linear-gradient(90deg, ${paint} 0 ${on}px, transparent 0 ${on + off}px)`;
    } else swatch.style.background = paint;
    swatch.className = line ? "playback-line" : "playback-patch";
    return made("span", { class: "playback-entry" }, swatch, name === layer ? "" : name);
  });
  return [...patches, ...lines];
}

let canDraw;
function supported() {
  if (canDraw === undefined) {
    const canvas = document.createElement("canvas");
    const context = canvas.getContext("webgl2") || canvas.getContext("webgl");
    canDraw = Boolean(context);
    context?.getExtension("WEBGL_lose_context")?.loseContext(); // browsers allow only a few
  }
  return canDraw;
}

// The keyboard belongs to the viewer that was used last.
let used;
function start() {
  const viewers = [...document.querySelectorAll("section.playback")].map((root) => {
    const viewer = (root.viewer3d = new PlaybackViewer(root));
    for (const kind of ["pointerdown", "focusin"]) root.addEventListener(kind, () => (used = viewer));
    return viewer;
  });
  used = viewers[0];
  window.geodesicOcp = { viewers };
  document.addEventListener("keydown", (event) => {
    if (!used || event.ctrlKey || event.metaKey || event.altKey || used.help.open) return;
    const { target } = event;
    const kind = target.tagName === "INPUT" ? target.type : target.tagName.toLowerCase();
    if (target.isContentEditable || ["select", "textarea", "summary", "a"].includes(kind)) return;
    if (target.tagName === "INPUT" && !["range", "checkbox"].includes(kind)) return;
    if (event.key === " " && ["button", "checkbox"].includes(kind)) return; // these have a use for it
    press(used, event);
  });
}
start();
