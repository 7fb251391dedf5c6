// What a page's markup cannot say: clicks and drags on the view and the curves, keys, dropped files.
(() => {
  const tell = (name, ...args) => window.trame && window.trame.trigger(name, args);
  const part = (event, element) => {
    const box = element.getBoundingClientRect();
    return [(event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height];
  };
  const on = (event, selector) => event.target instanceof Element && event.target.closest(selector);

  // The view: a press and release at one place is a click, all else turns the camera. A press is kept from
  // the camera until the pointer moves: a click then waits for no picture.
  let held = null;
  document.addEventListener("pointerdown", (e) => {
    held = null;
    if (e.isTrusted && on(e, "#view") && e.button === 0 && !e.shiftKey) { held = e; e.stopPropagation(); }
  }, true);
  document.addEventListener("pointermove", (e) => {
    if (!held || Math.hypot(e.clientX - held.clientX, e.clientY - held.clientY) < 4) return;
    const press = held;
    held = null;
    press.target.dispatchEvent(new PointerEvent("pointerdown", press));
  }, true);
  document.addEventListener("pointerup", (e) => {
    const view = held && on(e, "#view");
    if (view) { tell("click", ...part(e, view)); e.stopPropagation(); }
    if (!view && on(e, "#view")) rest();
    held = null;
  }, true);
  let resting = 0;
  const rest = () => { clearTimeout(resting); resting = setTimeout(() => tell("rest"), 120); };
  document.addEventListener("wheel", (e) => { if (on(e, "#view")) rest(); }, { capture: true, passive: true });
  let hovered = 0, over = false;
  document.addEventListener("pointermove", (e) => {
    const view = on(e, "#view");
    if (!view && over) { over = false; tell("away"); }
    if (!view || e.buttons || Date.now() - hovered < 90) return;
    hovered = Date.now();
    over = true;
    tell("hover", ...part(e, view));
  }, true);

  document.addEventListener("pointerleave", () => { if (over) { over = false; tell("away"); } });

  // The curves: pointing marks the place, dragging chooses a stretch.
  let from = null;
  const shade = (plot, to) => {
    const band = plot.querySelector(".dragged") || plot.appendChild(Object.assign(document.createElement("div"), { className: "dragged" }));
    band.style.left = 100 * Math.min(from, to) + "%";
    band.style.width = 100 * Math.abs(to - from) + "%";
  };
  document.addEventListener("pointerdown", (e) => { const plot = on(e, ".plot"); from = plot ? part(e, plot)[0] : null; if (plot) plot.setPointerCapture(e.pointerId); });
  document.addEventListener("pointermove", (e) => {
    const plot = on(e, ".plot");
    if (plot && from !== null && e.buttons) shade(plot, part(e, plot)[0]);
    if (plot && Date.now() - hovered >= 50) { hovered = Date.now(); tell("point", part(e, plot)[0]); }
  });
  document.addEventListener("pointerup", (e) => {
    const plot = on(e, ".plot");
    document.querySelectorAll(".dragged").forEach((band) => band.remove());
    if (plot && from !== null && Math.abs(part(e, plot)[0] - from) > 0.02) tell("stretch", from, part(e, plot)[0]);
    from = null;
  });

  // Keys. In fields they write, and elsewhere they act.
  const view_keys = {
    ArrowLeft: ["turn", -6, 0], ArrowRight: ["turn", 6, 0], ArrowUp: ["turn", 0, 6], ArrowDown: ["turn", 0, -6],
    "+": ["zoom", 1.15], "=": ["zoom", 1.15], "-": ["zoom", 0.87], Enter: ["click", 0.5, 0.5],
  };
  const shifted = {
    ArrowLeft: ["pan", -0.05, 0], ArrowRight: ["pan", 0.05, 0], ArrowUp: ["pan", 0, 0.05], ArrowDown: ["pan", 0, -0.05],
  };
  const anywhere = { f: ["fit"], d: ["theme"], Escape: ["stop"], "?": ["help"], Delete: ["remove"] };
  document.addEventListener("keydown", (e) => {
    if (e.ctrlKey || e.metaKey) {
      const act = { z: e.shiftKey ? "redo" : "undo", y: "redo", Z: "redo" }[e.key];
      if (act && !on(e, "input[type=number], input[type=text]")) { tell(act); e.preventDefault(); }
      if (e.key === "o") { document.querySelector("#file")?.click(); e.preventDefault(); }
      return;
    }
    if (on(e, "#view")) {
      const act = (e.shiftKey && shifted[e.key]) || view_keys[e.key];
      if (act) { tell(...act); e.preventDefault(); e.stopPropagation(); return; }
    }
    if (on(e, ".plot") && (e.key === "[" || e.key === "]")) { tell("bound", e.key === "[" ? 0 : 1); return; }
    if (on(e, ".plot") && (e.key === "ArrowLeft" || e.key === "ArrowRight")) {
      tell("step", e.key === "ArrowLeft" ? -1 : 1); e.preventDefault(); return;
    }
    if (!on(e, "input, select, textarea") && anywhere[e.key]) tell(...anywhere[e.key]);
  }, true);

  // After a ridge has another name its place in the list is where the keys go.
  document.addEventListener("focusout", (e) => {
    if (e.target.id === "new-name" && !e.relatedTarget) setTimeout(() => document.querySelector(".ridge.chosen .name")?.focus());
  });

  // Files: dropped on the page, or chosen.
  const leaves = (name) => !document.querySelector(".ridge")
    || confirm(`Open ${name}? The ridges of this scan are lost unless you save the page first.`);
  const send = async (file) => {
    if (!file) return;
    if (window.ridgeOpens !== "host" && !leaves(file.name)) return;
    tell("sending", file.name, file.size);
    let answer = null;
    try {
      const where = "/open?name=" + encodeURIComponent(file.name) + "&for=" + (window.ridgeOpens || "scan");
      answer = await fetch(where, { method: "POST", body: file });
    } catch (error) { tell("failed", `${file.name}: it could not be sent (${error.message})`); return; }
    if (!answer.ok) tell("failed", await answer.text());
  };
  window.ridgeSend = send;
  document.addEventListener("dragover", (e) => { e.preventDefault(); document.body.classList.add("dropping"); });
  document.addEventListener("dragleave", (e) => { if (!e.relatedTarget) document.body.classList.remove("dropping"); });
  document.addEventListener("drop", (e) => {
    e.preventDefault(); document.body.classList.remove("dropping"); send(e.dataTransfer.files[0]);
  });
  document.addEventListener("change", (e) => {
    if (e.target.id === "folder") {
      const name = e.target.value;
      e.target.selectedIndex = 0;
      if (leaves(name)) tell("open", name);
    }
    if (e.target.matches?.("#file, #host-file")) {
      window.ridgeOpens = e.target.id === "file" ? "scan" : "host";
      send(e.target.files[0]); e.target.value = ""; window.ridgeOpens = "scan";
    }
  });
})();
