"use strict";
// Draws every figure when it first comes into view, keeps the choices, and recolours axes with the page's theme.
(function () {
  const root = document.documentElement;
  const config = {
    responsive: true,
    displaylogo: false,
    modeBarButtonsToRemove: ["select2d", "lasso2d", "autoScale2d"],
    toImageButtonOptions: { scale: 2 },
  };

  function colours() {
    const style = getComputedStyle(document.body);
    return { text: style.color, card: getComputedStyle(document.querySelector("section") || document.body).backgroundColor };
  }

  function dress(layout) {
    const c = colours();
    layout.font = Object.assign({}, layout.font, { color: c.text });
    layout.hoverlabel = { bgcolor: c.card, font: { color: c.text } };
    return layout;
  }

  function draw(place) {
    if (place.dataset.drawn) return;
    place.dataset.drawn = "yes";
    const figure = JSON.parse(document.getElementById(place.dataset.figure).textContent);
    Plotly.newPlot(place, figure.data, dress(figure.layout), config).then(() => place.classList.remove("waiting"));
  }

  const seen = new IntersectionObserver(
    (entries) => entries.filter((e) => e.isIntersecting).forEach((e) => draw(e.target)),
    { rootMargin: "400px" }
  );
  document.querySelectorAll(".plot").forEach((place) => {
    place.classList.add("waiting");
    seen.observe(place);
  });

  document.querySelectorAll(".choice").forEach((choice) => {
    const buttons = Array.from(choice.querySelectorAll(":scope > .buttons > button"));
    const panels = Array.from(choice.querySelectorAll(":scope > .panel"));
    const show = (index) => {
      buttons.forEach((b, i) => b.setAttribute("aria-selected", String(i === index)));
      panels.forEach((p, i) => { p.hidden = i !== index; });
    };
    buttons.forEach((b, i) => b.addEventListener("click", () => show(i)));
    choice.querySelector(":scope > .buttons").addEventListener("keydown", (event) => {
      const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
      if (!step) return;
      const next = (buttons.indexOf(document.activeElement) + step + buttons.length) % buttons.length;
      buttons[next].focus();
      show(next);
    });
  });

  addEventListener("beforeprint", () => document.querySelectorAll("details").forEach((d) => { d.open = true; }));

  const order = ["auto", "light", "dark"];
  const button = document.getElementById("theme");
  function theme(name) {
    if (name === "auto") delete root.dataset.theme; else root.dataset.theme = name;
    button.textContent = "Theme: " + name;
    document.querySelectorAll(".plot[data-drawn]").forEach((place) => {
      if (place.layout) Plotly.relayout(place, dress({ font: place.layout.font }));
    });
  }
  button.addEventListener("click", () => theme(order[(order.indexOf(root.dataset.theme || "auto") + 1) % 3]));
  const asked = new URLSearchParams(location.search).get("theme");
  theme(order.includes(asked) ? asked : "auto");
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => theme(root.dataset.theme || "auto"));
})();
