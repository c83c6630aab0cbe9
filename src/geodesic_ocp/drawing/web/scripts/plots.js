// Plots beside or below the scenes: a cursor follows the time, with the values there in the legend,
// and a click or drag sets it. Curves of layers are drawn over the picture when these are on.

const SHOWN = 6; // plots at once

class Plots {
  constructor(viewer, element, { range, times, plots }) {
    this.range = range;
    const instants = times.map(unpacked);
    this.figures = [...element.querySelectorAll(".playback-plot")].map((figure, index) => {
      const [left, right, bottom, top, low, high] = figure.dataset.axes.split(" ").map(Number);
      const cursor = made("i");
      const lines = drawn("svg", { viewBox: "0 0 1 1", preserveAspectRatio: "none" });
      const picture = figure.firstElementChild;
      for (const { style } of [cursor, lines]) {
        [style.bottom, style.top] = [`${100 * bottom}%`, `${100 * (1 - top)}%`];
      }
      [lines.style.left, lines.style.width] = [`${100 * left}%`, `${100 * (right - left)}%`];
      lines.style.height = `${100 * (top - bottom)}%`;
      picture.append(lines, cursor);
      const seek = (event) => {
        if (event.type === "pointermove" && !picture.hasPointerCapture(event.pointerId)) return;
        const box = picture.getBoundingClientRect();
        const share = ((event.clientX - box.left) / box.width - left) / (right - left);
        viewer.seek(range[0] + share * (range[1] - range[0]));
      };
      picture.addEventListener("pointerdown", (event) => {
        if (event.button !== 0) return;
        picture.setPointerCapture(event.pointerId);
        seek(event);
      });
      picture.addEventListener("pointermove", seek);
      const entries = figure.querySelectorAll("figcaption > span");
      const digits = Math.min(6, Math.max(0, 2 - Math.floor(Math.log10(high - low))));
      const curves = plots[index].map(({ colour, dash, layer, time, values }, k) => {
        const curve = { layer, entry: entries[k], times: instants[time], values: unpacked(values) };
        curve.value = curve.entry.querySelector("b");
        if (layer) {
          const across = (t) => (t - range[0]) / (range[1] - range[0]);
          const spots = Array.from(curve.times, (t, i) => [across(t), (high - curve.values[i]) / (high - low)]);
          const known = spots.map(([x, y], i) => [y, `${i && !isNaN(spots[i - 1][1]) ? "L" : "M"}${x.toFixed(4)} ${y.toFixed(4)}`]);
          curve.line = drawn("path", {
            ...{ d: known.map(([y, step]) => (isNaN(y) ? "" : step)).join(""), stroke: colour },
            "stroke-dasharray": (dash ?? []).map((each) => 1.5 * each).join(" "),
          });
          lines.append(curve.line);
        }
        return curve;
      });
      return { figure, cursor, curves, digits, across: (share) => left + share * (right - left) };
    });
    if (this.figures.length > SHOWN) element.before(this.pages());
    this.turn(0);
  }

  // Buttons for the first six plots, the next six, and so on.
  pages() {
    const pages = made("div", { class: "playback-pages", role: "group", "aria-label": "plots" }, "Plots");
    for (let from = 0; from < this.figures.length; from += SHOWN) {
      const to = Math.min(from + SHOWN, this.figures.length);
      const name = to === from + 1 ? `${to}` : `${from + 1}–${to}`;
      pages.append(button(`plots ${name}`, name, () => this.turn(from)));
    }
    this.tabs = [...pages.querySelectorAll("button")];
    return pages;
  }

  turn(from) {
    this.figures.forEach(({ figure }, i) => (figure.hidden = i < from || i >= from + SHOWN));
    this.tabs?.forEach((tab, i) => tab.setAttribute("aria-pressed", String(SHOWN * i === from)));
    if (this.time !== undefined) this.show(this.time);
  }

  setLayer(name, on) {
    for (const curve of this.figures.flatMap(({ curves }) => curves)) {
      if (curve.layer !== name) continue;
      curve.entry.hidden = !on;
      curve.line.style.display = on ? "" : "none";
    }
  }

  show(time) {
    this.time = time;
    const [start, stop] = this.range;
    const share = stop > start ? (time - start) / (stop - start) : 0;
    for (const { figure, cursor, curves, digits, across } of this.figures) {
      if (figure.hidden) continue;
      cursor.style.left = `${100 * across(share)}%`;
      for (const { times, values, value } of curves) {
        const now = valueAt(times, values, time);
        const text = now.toFixed(digits).replace(/^-(?=[0.]+$)/, ""); // no negative zero
        value.textContent = isNaN(now) ? "–" : text.replace("-", "−");
      }
    }
  }
}

// Linear between two samples; NaN outside them, but for the rounding of the times.
function valueAt(times, values, time) {
  const [low, fraction] = sampleAt(times, time);
  const high = Math.min(low + 1, times.length - 1);
  const close = 1e-4 * (times[times.length - 1] - times[0]);
  if (time < times[0] - close || time > times[times.length - 1] + close) return NaN;
  return fraction ? (1 - fraction) * values[low] + fraction * values[high] : values[low];
}
