// Makes a page one of pictures: window.geodesicOcp.film(around) leaves out what is there for the
// hand, and geodesicOcp.frame(time, angle) draws one instant, from a camera turned by an angle.

(function () {
  const [COLUMNS, PLOTS] = [4, 3]; // panes side by side, and plots, at most
  const [PANE, PLOT, BESIDE] = [180, 270, 700]; // [px], least widths: of each, and of a pane with plots
  const [SLENDER, WIDE] = [0.8, 1.6]; // width of a pane, relative to its height
  const AROUND = Array.from({ length: 16 }, (_, k) => (k * Math.PI) / 8);
  const viewer = window.geodesicOcp.viewers[0];
  const { panes, root, data } = viewer;
  const up = { x: 0, y: 0, z: 1 };
  const turned = (axis, angle) => panes[0].home.clone().fromArray(axis).applyAxisAngle(up, angle).toArray();

  // Least width or height of a scene in the first view, at a distance.
  const extent = ({ points }, [x, y, z]) => {
    const along = points.map((point) => point.x * x + point.y * y + point.z * z);
    return Math.max(...along) - Math.min(...along);
  };

  window.geodesicOcp.film = (around) => {
    // What turns has room on all sides.
    for (const pane of around ? panes : []) {
      const middle = pane.box.getCenter(pane.home.clone());
      const ring = (point) => AROUND.map((angle) => point.clone().sub(middle).applyAxisAngle(up, angle).add(middle));
      pane.points = pane.points.flatMap(ring);
    }
    const width = root.clientWidth;
    const figures = viewer.plots.figures.map(({ figure }) => figure);
    const beside = panes.length === 1 && figures.length > 0 && width >= BESIDE;
    const shown = Math.min(PLOTS, figures.length, beside ? PLOTS : Math.max(1, Math.floor(width / PLOT)));
    figures.forEach((figure, index) => (figure.hidden = index >= shown));
    root.classList.toggle("playback-beside", beside);
    const row = panes.length <= COLUMNS ? panes.length : Math.ceil(panes.length / 2);
    const [across, high] = [0, 1].map((axis) => Math.max(...panes.map((pane) => extent(pane, data.axes[axis]))));
    const look = {
      columns: Math.min(row, Math.max(1, Math.floor(width / PANE))),
      plots: shown,
      aspect: Math.min(WIDE, Math.max(SLENDER, across / high)),
    };
    for (const [name, value] of Object.entries(look)) root.style.setProperty(`--${name}`, value);
    viewer.reset();
    return document.documentElement.offsetHeight;
  };

  window.geodesicOcp.frame = (time, angle) => {
    if (angle) {
      const axes = data.axes.map((axis) => turned(axis, angle));
      const views = panes.map((pane) => pane.fit(axes));
      const distance = Math.max(...views.map((view) => view.distance));
      viewer.moveCameras(() => panes.forEach((pane, i) => pane.look(views[i], distance)));
    }
    viewer.seek(time);
  };
})();
