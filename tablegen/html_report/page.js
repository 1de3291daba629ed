"use strict";
// Values under the pointer, and zoom. The page is complete without this.
(() => {
  const NS = "http://www.w3.org/2000/svg", FINE = 100;
  const make = (name, attributes, parent) => {
    const made = document.createElementNS(NS, name);
    for (const key in attributes) made.setAttribute(key, attributes[key]);
    if (parent) parent.appendChild(made);
    return made;
  };
  const points = (d) => {  // "M x y l dx dy ..." in runs, as drawn; further letters close an area
    const found = [];
    for (const run of d.split("M").slice(1)) {
      const [start, rest] = run.split(/[lhV]/);
      let [x, y] = start.split(" ").map(Number);
      found.push([x, y]);
      if (!run.includes("l")) continue;
      const steps = rest.split(" ").map(Number);
      for (let i = 0; i + 1 < steps.length; i += 2) found.push([x += steps[i], y += steps[i + 1]]);
    }
    return found;
  };
  const ticks = (low, high) => {
    const raw = (high - low) / 5, ten = 10 ** Math.floor(Math.log10(raw));
    const step = ten * [1, 2, 5, 10].find((size) => size * ten >= raw * 0.999);
    const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9)), found = [];
    for (let i = Math.ceil(low / step - 1e-9); i <= high / step + 1e-9; i++)
      found.push([i * step, (i * step).toFixed(Math.min(digits, 9))]);
    return found;
  };
  const shown = (value) => Math.abs(value) >= 1e5 || (value && Math.abs(value) < 1e-3)
    ? value.toExponential(3) : String(Number(value.toPrecision(5)));

  for (const chart of document.querySelectorAll("svg.chart")) {
    const inner = chart.querySelector(".inner"), grid = chart.querySelector(".ticks");
    const [left, top, width, height] = ["x", "y", "width", "height"].map((key) => Number(inner.getAttribute(key)));
    const [x0, x1] = chart.dataset.x.split(" ").map(Number), [y0, y1] = chart.dataset.y.split(" ").map(Number);
    const log = chart.dataset.log === "1", whole = [0, 0, width * FINE, height * FINE];
    const curves = [...chart.querySelectorAll(".inner .curve")]
      .map((path) => ({name: path.dataset.name, points: points(path.getAttribute("d"))}));
    const labels = [...chart.querySelectorAll(".label")].map((text) => text.textContent);
    const output = document.createElement("output"), reset = document.createElement("button");
    reset.type = "button"; reset.textContent = "whole chart"; reset.hidden = true;
    chart.after(output);
    chart.parentElement.querySelector("figcaption").append(reset);
    const cursor = make("path", {class: "cursor", visibility: "hidden"}, inner);
    const choice = make("rect", {class: "choice", visibility: "hidden"}, inner);
    let view = whole, from = null, at = null;

    const valueX = (x) => log ? x0 * (x1 / x0) ** (x / whole[2]) : x0 + (x1 - x0) * x / whole[2];
    const valueY = (y) => y1 - (y1 - y0) * y / whole[3];
    const place = (event) => {
      const box = chart.getBoundingClientRect(), scale = chart.viewBox.baseVal.width / box.width;
      const x = ((event.clientX - box.left) * scale - left) / width, y = ((event.clientY - box.top) * scale - top) / height;
      const inside = x >= 0 && x <= 1 && y >= 0 && y <= 1, cut = (share) => Math.min(1, Math.max(0, share));
      return {inside, x: view[0] + cut(x) * view[2], y: view[1] + cut(y) * view[3]};
    };
    const tell = (x) => {
      at = x;
      cursor.setAttribute("d", `M${x} 0V${whole[3]}`);
      cursor.setAttribute("visibility", "visible");
      const said = [];
      for (const curve of curves) {
        let best = null;
        for (const point of curve.points) if (!best || Math.abs(point[0] - x) < Math.abs(best[0] - x)) best = point;
        if (best && Math.abs(best[0] - x) < 0.03 * view[2]) said.push(`${curve.name || labels[1]} ${shown(valueY(best[1]))}`);
      }
      output.textContent = `${labels[0]}: ${shown(valueX(x))}  \u2192  ${labels[1]}: ${said.join(", ") || "-"}`;
    };
    const quiet = () => { cursor.setAttribute("visibility", "hidden"); output.textContent = ""; at = null; };
    const zoom = (to) => {
      view = to;
      inner.setAttribute("viewBox", view.join(" "));
      reset.hidden = view === whole;
      chart.querySelector(".words").setAttribute("visibility", view === whole ? "visible" : "hidden");
      if (view === whole) { grid.replaceChildren(...first); return; }
      grid.replaceChildren();
      const ends = [valueX(view[0]), valueX(view[0] + view[2])];
      for (const [value, text] of ticks(...ends)) {
        const share = log ? Math.log(value / ends[0]) / Math.log(ends[1] / ends[0]) : (value - ends[0]) / (ends[1] - ends[0]);
        const x = left + width * share;
        make("path", {d: `M${x} ${top}v${height}`}, grid);
        make("text", {x, y: top + height + 16, "text-anchor": "middle"}, grid).textContent = text;
      }
      const high = valueY(view[1]), low = valueY(view[1] + view[3]);
      for (const [value, text] of ticks(low, high)) {
        const y = top + height * (high - value) / (high - low);
        make("path", {d: `M${left} ${y}h${width}`}, grid);
        make("text", {x: left - 6, y: y + 4, "text-anchor": "end"}, grid).textContent = text;
      }
    };
    const first = [...grid.childNodes];
    const chosen = (to) => [Math.min(from.x, to.x), Math.min(from.y, to.y), Math.abs(to.x - from.x), Math.abs(to.y - from.y)];

    chart.addEventListener("pointerdown", (event) => {
      const where = place(event);
      if (!where.inside || event.button || event.pointerType === "touch") return;
      from = where;
      chart.setPointerCapture(event.pointerId);
    });
    chart.addEventListener("pointermove", (event) => {
      const where = place(event);
      if (where.inside || from) tell(where.x); else quiet();
      if (!from) return;
      const [x, y, w, h] = chosen(where);
      for (const [key, value] of Object.entries({x, y, width: w, height: h, visibility: "visible"})) choice.setAttribute(key, value);
    });
    chart.addEventListener("pointerup", (event) => {
      choice.setAttribute("visibility", "hidden");
      if (!from) return;
      const box = chosen(place(event));
      from = null;
      if (box[2] > 0.02 * view[2] && box[3] > 0.02 * view[3]) zoom(box);
    });
    chart.addEventListener("pointercancel", () => { from = null; choice.setAttribute("visibility", "hidden"); });
    chart.addEventListener("pointerleave", quiet);
    chart.addEventListener("blur", quiet);
    chart.addEventListener("dblclick", () => zoom(whole));
    reset.addEventListener("click", () => zoom(whole));
    chart.addEventListener("keydown", (event) => {
      const step = {ArrowLeft: -1, ArrowRight: 1}[event.key];
      if (event.key === "Escape") { zoom(whole); quiet(); }
      if (!step) return;
      event.preventDefault();
      const now = at === null ? view[0] + view[2] / 2 : at;
      tell(Math.min(view[0] + view[2], Math.max(view[0], now + step * view[2] / 100)));
    });
  }
  for (const picture of document.querySelectorAll("svg.picture")) {
    const tall = Number(picture.dataset.tall), size = (picture.dataset.size || "").split(" ").map(Number);
    const low = Number(picture.dataset.low), high = Number(picture.dataset.high), unit = picture.dataset.unit;
    const output = document.createElement("output"), loaded = new Image();
    let pixels = null;
    picture.after(output);
    loaded.addEventListener("load", () => {
      const canvas = document.createElement("canvas");
      canvas.width = loaded.width; canvas.height = loaded.height;
      const drawing = canvas.getContext("2d", {willReadFrequently: true});
      drawing.drawImage(loaded, 0, 0);
      pixels = drawing.getImageData(0, 0, canvas.width, canvas.height);
    });
    if (unit) loaded.src = picture.querySelector("image").getAttribute("href");
    picture.addEventListener("pointermove", (event) => {
      const box = picture.getBoundingClientRect(), scale = picture.viewBox.baseVal.width / box.width;
      const x = (event.clientX - box.left) * scale / 1000, y = (event.clientY - box.top) * scale / tall;
      if (x < 0 || x >= 1 || y < 0 || y >= 1) { output.textContent = ""; return; }
      const said = size.length > 1 ? [`x ${shown(Number((x * size[0]).toPrecision(3)))} nm, y ${shown(Number(((1 - y) * size[1]).toPrecision(3)))} nm`] : [];
      if (pixels) {
        const at = 4 * (Math.floor(y * pixels.height) * pixels.width + Math.floor(x * pixels.width)), [red, , blue] = pixels.data.slice(at, at + 3);
        said.push(red === blue ? `height ${(low + (high - low) * red / 255).toPrecision(3)} ${unit}` : "nothing was imaged here");
      }
      output.textContent = said.join(", ");
    });
    picture.addEventListener("pointerleave", () => { output.textContent = ""; });
  }
  // What is folded is printed too.
  const folded = () => document.querySelectorAll("details:not([open])");
  let opened = [];
  addEventListener("beforeprint", () => { opened = [...folded()]; for (const one of opened) one.open = true; });
  addEventListener("afterprint", () => { for (const one of opened) one.open = false; });
})();
