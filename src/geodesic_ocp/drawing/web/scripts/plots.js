// Plots below the scenes: a cursor follows the time, and a click or drag sets it.

const SHOWN = 6; // plots at once

class Plots {
  constructor(viewer, element, range) {
    [this.element, this.range] = [element, range];
    this.figures = [...element.querySelectorAll(".playback-plot")];
    this.cursors = this.figures.map((figure) => {
      const cursor = made("i");
      const [, , bottom, top] = this.place(figure);
      [cursor.style.bottom, cursor.style.top] = [`${100 * bottom}%`, `${100 * (1 - top)}%`];
      figure.append(cursor);
      const seek = (event) => {
        if (event.type === "pointermove" && !figure.hasPointerCapture(event.pointerId)) return;
        const { left, width } = figure.getBoundingClientRect();
        const [from, to] = this.place(figure);
        const share = ((event.clientX - left) / width - from) / (to - from);
        viewer.seek(range[0] + share * (range[1] - range[0]));
      };
      figure.addEventListener("pointerdown", (event) => {
        if (event.button !== 0) return;
        figure.setPointerCapture(event.pointerId);
        seek(event);
      });
      figure.addEventListener("pointermove", seek);
      return cursor;
    });
    if (this.figures.length > SHOWN) element.before(this.pages());
    this.turn(0);
  }

  // Left, right, bottom and top of its axes.
  place(figure) {
    return figure.dataset.axes.split(" ").map(Number);
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
    this.figures.forEach((figure, i) => (figure.hidden = i < from || i >= from + SHOWN));
    this.tabs?.forEach((tab, i) => tab.setAttribute("aria-pressed", String(SHOWN * i === from)));
  }

  show(time) {
    const [start, stop] = this.range;
    const share = stop > start ? (time - start) / (stop - start) : 0;
    this.figures.forEach((figure, index) => {
      const [from, to] = this.place(figure);
      this.cursors[index].style.left = `${100 * (from + share * (to - from))}%`;
    });
  }
}
