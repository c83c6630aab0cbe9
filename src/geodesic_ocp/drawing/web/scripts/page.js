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
    this.plots = new Plots(this, plots, data);
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
      const views = this.panes.map((pane) => pane.fit(this.data.axes));
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

  // Switches of layers with the colours of what they show, and buttons for the view.
  tools(data) {
    const list = made("div", { class: "playback-layers" });
    this.switches = {};
    for (const name of ["", ...Object.keys(this.layers)]) {
      const marks = legend(data, name);
      if (name && marks.length === 1) marks[0].lastChild.remove(); // the layer's name says enough
      const alone = marks.filter((mark) => !mark.textContent);
      const group = made("div");
      if (name) {
        const box = (this.switches[name] = made("input", { type: "checkbox" }));
        box.addEventListener("change", () => this.setLayer(name, box.checked));
        group.append(made("label", {}, box, ...alone, name));
      }
      group.append(...marks.filter((mark) => mark.textContent));
      if (group.children.length) list.append(group);
    }
    const view = made("div", { class: "playback-buttons" });
    if (this.panes.length) view.append(button("first view", icon("reset"), () => this.reset()));
    if (document.fullscreenEnabled) {
      view.append(button("full screen", icon("full"), () => this.toggleFull()));
    }
    view.append(button("help", "?", () => this.help.showModal()));
    const shown = made("details", { open: "" }, made("summary", {}, "Show"), list);
    if (!this.panes.length || !list.children.length) shown.hidden = true;
    return made("div", { class: "playback-tools" }, shown, view);
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

  toggle() {
    if (this.playing) this.pause();
    else this.play();
  }

  setLayer(name, on) {
    if (!(name in this.layers)) return;
    this.layers[name] = Boolean(on);
    this.switches[name].checked = this.layers[name];
    for (const pane of this.panes) pane.setLayer(name, this.layers[name]);
    this.plots.setLayer(name, this.layers[name]);
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
    for (const pane of this.panes) if (pane.stale) pane.render();
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

// What the colours of a layer mean, as in the plots: an entry for each.
function legend(data, layer) {
  const found = new Map(); // by colour: the names that have it, and whether it is that of a line
  const add = (paint, name, dash = null) => {
    if (!found.has(paint)) found.set(paint, { names: new Set(), dash });
    found.get(paint).names.add(name);
    found.get(paint).dash ??= dash;
  };
  for (const scene of data.scenes) {
    const own = (kind) => scene[kind].filter((item) => item.layer === layer);
    for (const { role, name } of own("trails")) add(data.roles[role].colour, name, data.roles[role].dash ?? [1, 0]);
    for (const { role, name } of own("actors")) if (role) add(data.roles[role].colour, name);
    for (const { role, name } of own("clouds")) add(role ? data.roles[role].colour : data.colours.marker, name);
    for (const [kind, paint] of [["solids", data.colours.obstacle], ["ellipsoids", data.colours.ellipsoid]]) {
      for (const { name } of own(kind)) add(paint, name);
    }
  }
  return [...found].map(([paint, { names, dash }]) => {
    const swatch = made("i", { class: dash ? "playback-line" : "playback-patch" });
    const [on, off] = (dash ?? [1, 0]).map((each) => 3 * each);
    swatch.style.background = `repeating-linear-gradient(90deg, ${paint} 0 ${on}px, transparent 0 ${on + off}px)`;
    return made("span", { class: "playback-entry", title: [...names].join(", ") }, swatch, common([...names]));
  });
}

// One name for several: the one that all have in theirs, or the starts of all.
function common(names) {
  const shared = names.find((name) => names.every((other) => other.includes(name)));
  return shared ?? [...new Set(names.map((name) => name.split(", ")[0]))].join(", ");
}

let canDraw;
function supported() {
  if (canDraw === undefined) {
    const canvas = document.createElement("canvas");
    const context = canvas.getContext("webgl2");
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
  if (window.parent !== window) {
    // In a frame, whose page may make it as tall as this one.
    document.documentElement.classList.add("playback-framed");
    const tell = () => window.parent.postMessage({ geodesicOcpHeight: document.body.offsetHeight }, "*");
    new ResizeObserver(() => document.fullscreenElement || tell()).observe(document.body);
  }
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
