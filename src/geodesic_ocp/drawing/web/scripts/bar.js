// The playback bar: play, speed, slider, and rows of named spans above which a cursor moves.

const SPEEDS = [0.25, 0.5, 1, 2, 4];
const PASS = 4; // [s] in which a path parameter goes from its start to its end
const ICONS = {
  play: "M5 3 L19 12 L5 21 Z",
  pause: "M5 3 H10 V21 H5 Z M14 3 H19 V21 H14 Z",
  reset: "M12 5 V1 L6 6 L12 11 V7 A5.5 5.5 0 1 1 6.5 12.5 H4.2 A7.8 7.8 0 1 0 12 5 Z",
  full: "M3 3 H10 V5 H5 V10 H3 Z M14 3 H21 V10 H19 V5 H14 Z M3 14 H5 V19 H10 V21 H3 Z M19 14 H21 V21 H14 V19 H19 Z",
};

// An element with attributes and contents; text is never read as HTML.
function made(tag, attributes = {}, ...contents) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  element.append(...contents);
  return element;
}

// The same for an element of SVG.
function drawn(tag, attributes, ...contents) {
  const element = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  element.append(...contents);
  return element;
}

function icon(name) {
  return drawn("svg", { viewBox: "0 0 24 24", "aria-hidden": "true" }, drawn("path", { d: ICONS[name] }));
}

function button(label, content, action) {
  const element = made("button", { type: "button", "aria-label": label, title: label }, content);
  element.addEventListener("click", action);
  return element;
}

class Bar {
  constructor(viewer, data) {
    [this.viewer, this.data] = [viewer, data];
    const [start, stop] = data.range;
    this.play = button("play", icon("play"), () => viewer.toggle());
    this.play.classList.add("playback-play");
    this.speed = made("select", { "aria-label": "speed" });
    for (const speed of SPEEDS) this.speed.append(made("option", { value: speed }, `${speed}×`));
    this.speed.value = 1;
    this.speed.addEventListener("change", () => (viewer.speed = Number(this.speed.value)));
    this.loop = made("input", { type: "checkbox" });
    this.loop.addEventListener("change", () => (viewer.loop = this.loop.checked));
    this.clock = made("output", { "aria-label": "time" });
    this.slider = made("input", {
      ...{ type: "range", min: start, max: stop, step: "any", value: start },
      "aria-label": data.parameter ? "path parameter" : "time in seconds",
    });
    this.slider.addEventListener("input", () => viewer.seek(Number(this.slider.value)));
    this.rows = data.spans.map(([name, spans]) => this.row(name, spans));
    this.element = made(
      ...["div", { class: "playback-bar" }],
      made(
        ...["div", { class: "playback-controls" }],
        ...[this.play, this.clock, this.speed, made("label", {}, this.loop, "loop")]
      ),
      made("div", { class: "playback-track" }, this.slider),
      ...this.rows.flatMap(({ label, track }) => [label, track])
    );
    new ResizeObserver(() => this.fitNames()).observe(this.element);
  }

  // Where a time is on the track.
  share(time) {
    const [start, stop] = this.data.range;
    return `${(100 * (time - start)) / (stop - start)}%`;
  }

  row(name, spans) {
    const current = made("b");
    const label = made("div", { class: "playback-row" }, made("span", { title: name }, name), current);
    const cursor = made("i");
    const track = made("div", { class: "playback-track playback-spans" });
    const line = made("div");
    const pieces = spans.map(([span, from, to, text, cut]) => {
      const piece = button(text || span, made("span", {}, span), () => this.viewer.seek(from));
      piece.tabIndex = -1; // the keyboard has shift and arrows
      piece.style.left = this.share(from);
      piece.style.width = `calc(${this.share(to)} - ${this.share(from)})`;
      if (cut) piece.classList.add(`playback-${cut}`);
      line.append(piece);
      return piece;
    });
    line.append(cursor);
    track.append(line);
    return { spans, current, label, cursor, pieces, track };
  }

  // Names of spans that are too narrow are left to the row's label.
  fitNames() {
    for (const piece of this.rows.flatMap((row) => row.pieces)) {
      const text = piece.firstChild;
      text.style.visibility = text.offsetWidth + 4 > piece.clientWidth ? "hidden" : "visible";
    }
  }

  text(time) {
    const [start, stop] = this.data.range;
    if (this.data.parameter) return `s = ${time.toFixed(2)}`;
    const digits = stop - start < 1 ? 3 : 2;
    return `${time.toFixed(digits)} / ${stop.toFixed(digits)} s`;
  }

  show(time) {
    this.clock.textContent = this.text(time);
    this.slider.value = time;
    this.slider.style.setProperty("--done", this.share(time));
    const names = [];
    for (const { spans, current, cursor, pieces } of this.rows) {
      const now = spanAt(spans, time);
      cursor.style.left = this.share(time);
      pieces.forEach((piece, index) => piece.classList.toggle("playback-now", index === now));
      const text = now < 0 ? "–" : spans[now][3] || spans[now][0];
      if (current.textContent !== text) current.textContent = text;
      if (now >= 0) names.push(text);
    }
    this.slider.setAttribute("aria-valuetext", [this.text(time), ...names].join(", "));
  }

  showState() {
    const { playing, speed, loop } = this.viewer;
    const name = playing ? "pause" : "play";
    if (this.play.title !== name) {
      this.play.replaceChildren(icon(name));
      this.play.title = name;
      this.play.setAttribute("aria-label", name);
    }
    this.speed.value = speed;
    this.loop.checked = loop;
  }
}

// Index of the span at a time, the later one where two meet; -1 between spans.
function spanAt(spans, time) {
  let found = -1;
  spans.forEach(([, from, to], index) => {
    if (from <= time && time <= to) found = index;
  });
  return found;
}
