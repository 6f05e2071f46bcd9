"use strict";
(() => {
  const table = document.querySelector(".turntable");
  const view = table.querySelector(".window");
  const strip = table.querySelector("img");
  const slider = table.querySelector("input");
  const button = table.querySelector("button");
  const count = Number(slider.max) + 1;

  const show = () => {
    strip.style.transform = `translateY(${(-100 * slider.value) / count}%)`;
  };
  const turn = (to) => {
    slider.value = ((to % count) + count) % count;
    show();
  };

  let timer = 0;
  const play = (on) => {
    clearInterval(timer);
    timer = on ? setInterval(() => turn(Number(slider.value) + 1), 100) : 0;
    button.textContent = on ? "Stop" : "Play";
  };
  button.addEventListener("click", () => play(!timer));
  slider.addEventListener("input", () => {
    play(false);
    show();
  });

  // Half a turn from one edge of the picture to the other.
  let from = null;
  view.addEventListener("pointerdown", (event) => {
    play(false);
    from = { x: event.clientX, at: Number(slider.value) };
    view.setPointerCapture(event.pointerId);
  });
  view.addEventListener("pointermove", (event) => {
    if (from) {
      const share = (event.clientX - from.x) / view.clientWidth;
      turn(from.at - Math.round((share * count) / 2));
    }
  });
  for (const end of ["pointerup", "pointercancel"]) {
    view.addEventListener(end, () => {
      from = null;
    });
  }

  view.classList.add("turns");
  table.querySelector(".controls").hidden = false;
  // A reloaded page may remember where the slider was.
  show();
})();
