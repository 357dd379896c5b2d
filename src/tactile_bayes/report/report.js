"use strict";
(function () {
  const data = JSON.parse(document.getElementById("data").textContent);
  const by = (id) => document.getElementById(id);
  document.documentElement.classList.add("scripted");

  // The band: a place along x, chosen by the slider or by the pointer.
  const band = data.band, place = by("band-place"), rule = by("band-rule"), dot = by("band-mark");
  function showPlace(index) {
    place.value = index;
    rule.setAttribute("x1", band.x[index]);
    rule.setAttribute("x2", band.x[index]);
    dot.setAttribute("transform", "translate(" + band.mapX[index] + " " + band.mapY[index] + ")");
    by("band-said").textContent = band.said[index];
    place.setAttribute("aria-valuetext", band.said[index]);
  }
  function follow(svg, places) {
    svg.addEventListener("pointermove", function (event) {
      const box = svg.getBoundingClientRect();
      const x = (event.clientX - box.left) * svg.viewBox.baseVal.width / box.width;
      let nearest = 0;
      places.forEach((at, index) => {
        if (Math.abs(at - x) < Math.abs(places[nearest] - x)) nearest = index;
      });
      showPlace(nearest);
    });
  }
  place.addEventListener("input", () => showPlace(Number(place.value)));
  follow(by("contour-map"), band.mapX);
  follow(by("band-detail"), band.x);
  showPlace(band.first);

  // The rod: a frame for each sample of the sweep that is chosen.
  const frames = data.frames, slider = by("sample"), chosen = by("sweep"), play = by("play");
  const marks = Array.from(document.querySelectorAll(".mark.moving"));
  const rules = Array.from(document.querySelectorAll(".rule.moving"));
  const rows = Array.from(document.querySelectorAll("#numbers tbody tr"));
  let sweep = frames.sweeps[0].frames, timer = 0;

  function arrow(id, from, force) {
    const line = by(id), seen = from !== null && Math.hypot(force[0], force[1]) > 3;
    line.setAttribute("visibility", seen ? "visible" : "hidden");
    if (!seen) return;
    line.setAttribute("x1", from[0]);
    line.setAttribute("y1", from[1]);
    line.setAttribute("x2", from[0] + force[0]);
    line.setAttribute("y2", from[1] + force[1]);
  }
  function turn(pivot, share) {
    const path = by("moment"), radius = 24, most = 1.5 * Math.PI;
    path.setAttribute("visibility", Math.abs(share) > 0.04 ? "visible" : "hidden");
    // Counter-clockwise for a positive moment; y grows downward in a drawing.
    const angle = share * most, begin = -0.5 * Math.PI;
    const at = (off) => [pivot[0] + radius * Math.cos(begin - off), pivot[1] + radius * Math.sin(begin - off)];
    const a = at(0), b = at(angle);
    path.setAttribute("d", "M" + a + "A" + [radius, radius, 0, Math.abs(angle) > Math.PI ? 1 : 0, angle > 0 ? 0 : 1] + " " + b);
  }
  function showFrame(index) {
    const frame = sweep[index], rod = frames.rod[frame], force = frames.force[frame], said = frames.said;
    slider.value = index;
    by("rod").setAttribute("points", rod.join(" "));
    const contact = frames.contact[frame], touch = by("contact");
    touch.setAttribute("class", "touch " + frames.phase[frame]);
    touch.setAttribute("cx", contact ? contact[0] : -20);
    touch.setAttribute("cy", contact ? contact[1] : -20);
    arrow("reaction", contact && [rod[0], rod[1]], force);
    arrow("thrust", contact, [-force[0], -force[1]]);
    turn([rod[0], rod[1]], frames.moment[frame]);
    rules.forEach((line) => {
      line.setAttribute("x1", frames.angle[frame]);
      line.setAttribute("x2", frames.angle[frame]);
    });
    marks.forEach((mark) => {
      const at = frames.marks[mark.dataset.channel][frame];
      mark.setAttribute("visibility", at === null ? "hidden" : "visible");
      mark.setAttribute("cx", frames.angle[frame]);
      if (at !== null) mark.setAttribute("cy", at);
    });
    by("said-sample").textContent = said.sample[frame];
    by("said-angle").textContent = said.angle[frame];
    by("said-travel").textContent = said.travel[frame];
    by("said-contact").textContent = said.contact[frame];
    rows.forEach((row) => {
      said[row.dataset.channel][frame].forEach((text, k) => { row.cells[k + 1].textContent = text; });
    });
    slider.setAttribute("aria-valuetext", "sample " + said.sample[frame] + ", drive angle " + said.angle[frame] + " degrees" + said.travel[frame]);
  }
  function showSweep(index, at) {
    sweep = frames.sweeps[index].frames;
    chosen.value = index;
    slider.max = sweep.length - 1;
    showFrame(at);
  }
  function stop() {
    window.clearInterval(timer);
    timer = 0;
    play.textContent = "Play";
    play.setAttribute("aria-pressed", "false");
  }
  function step() {
    const next = Number(slider.value) + 1;
    if (next >= sweep.length) stop();
    else showFrame(next);
  }
  slider.addEventListener("input", function () { stop(); showFrame(Number(slider.value)); });
  slider.addEventListener("keydown", function (event) {
    const leap = { PageUp: 10, PageDown: -10 }[event.key];
    if (!leap) return;
    event.preventDefault();
    stop();
    showFrame(Math.min(sweep.length - 1, Math.max(0, Number(slider.value) + leap)));
  });
  chosen.addEventListener("change", function () { stop(); showSweep(Number(chosen.value), 0); });
  play.addEventListener("click", function () {
    if (timer) { stop(); return; }
    if (Number(slider.value) >= sweep.length - 1) showFrame(0);
    play.textContent = "Pause";
    play.setAttribute("aria-pressed", "true");
    timer = window.setInterval(step, Math.max(40, 8000 / sweep.length));
  });
  const calm = window.matchMedia("(prefers-reduced-motion: reduce)");
  function respect() {
    play.hidden = calm.matches;
    by("still").hidden = !calm.matches;
    if (calm.matches && timer) stop();
  }
  calm.addEventListener("change", respect);
  respect();

  showSweep(0, frames.sweeps[0].frames.indexOf(frames.first));
})();
