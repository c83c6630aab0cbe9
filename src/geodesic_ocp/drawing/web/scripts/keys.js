// What keys do, and the list of them.

const KEYS = [
  ["Space", "play or pause"],
  ["← →", "back or on by 0.1 s"],
  [", .", "back or on by one sample"],
  ["Shift + ← →", "to the previous or next span"],
  ["Home End", "to the start or the end"],
  ["+ −", "faster or slower"],
  ["L", "play again from the start at the end"],
  ["R", "first view again"],
  ["F", "full screen"],
  ["Tab", "to a view, which then turns by ← → ↑ ↓ and zooms by Page ↑ ↓"],
  ["?", "this list"],
];
// Angles [rad] to the right and upwards, and distances, by which keys move a camera.
const MOVES = {
  ArrowLeft: [-0.15, 0, 1],
  ArrowRight: [0.15, 0, 1],
  ArrowUp: [0, 0.15, 1],
  ArrowDown: [0, -0.15, 1],
  PageUp: [0, 0, 0.87],
  PageDown: [0, 0, 1.15],
};

// Does what a key stands for, if it stands for something.
function press(viewer, event) {
  const { range, data } = viewer;
  const pane = viewer.panes.find(({ element, byKeys }) => byKeys && element === event.target);
  if (pane && MOVES[event.key] && !event.shiftKey) {
    event.preventDefault();
    pane.turn(...MOVES[event.key]);
    return;
  }
  const step = data.parameter ? (range[1] - range[0]) / 40 : 0.1;
  const samples = () => viewer.panes.flatMap((pane) => [...pane.drawing.samples]);
  const starts = () => [...data.spans.flatMap(([, spans]) => spans.map(([, from]) => from)), ...range];
  const faster = (by) => {
    const index = SPEEDS.indexOf(viewer.speed) + by;
    viewer.speed = SPEEDS[Math.min(SPEEDS.length - 1, Math.max(0, index))];
  };
  const views = {
    r: () => viewer.reset(),
    f: () => viewer.toggleFull(),
    "?": () => viewer.help.showModal(),
  };
  const times = {
    " ": () => viewer.toggle(),
    ArrowLeft: () => (event.shiftKey ? next(viewer, starts(), -1) : viewer.seek(viewer.time - step)),
    ArrowRight: () => (event.shiftKey ? next(viewer, starts(), 1) : viewer.seek(viewer.time + step)),
    ",": () => next(viewer, samples(), -1),
    ".": () => next(viewer, samples(), 1),
    Home: () => viewer.seek(range[0]),
    End: () => viewer.seek(range[1]),
    "+": () => faster(1),
    "-": () => faster(-1),
    l: () => (viewer.loop = !viewer.loop),
  };
  const actions = viewer.bar ? { ...views, ...times } : views;
  const action = actions[event.key] ?? actions[event.key.toLowerCase()];
  if (!action) return;
  event.preventDefault();
  action();
}

// To the closest of these times before or after the present one.
function next(viewer, times, direction) {
  const close = 1e-6 * (viewer.range[1] - viewer.range[0]);
  const ahead = times.filter((time) => direction * (time - viewer.time) > close);
  if (ahead.length) viewer.seek(ahead.reduce(direction > 0 ? (a, b) => Math.min(a, b) : (a, b) => Math.max(a, b)));
}

function help(scale) {
  const list = made("dl");
  for (const [keys, meaning] of KEYS) list.append(made("dt", {}, keys), made("dd", {}, meaning));
  const dialog = made("dialog", { class: "playback-help", "aria-label": "help" }, list);
  dialog.append(
    made("p", {}, "Drag to turn, right button or two fingers to move, double-click for the first view. " +
      "Two fingers or the wheel zoom: the wheel after a click on the view or with Ctrl, otherwise it " +
      "scrolls the page. All panes have one scale." + scale),
    button("close", "Close", () => dialog.close())
  );
  dialog.addEventListener("click", (event) => event.target === dialog && dialog.close());
  return dialog;
}
