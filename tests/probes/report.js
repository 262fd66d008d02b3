const plot = document.querySelector(".plot");
const panels = [...plot.querySelectorAll(".panel")];
const place = plot.parentElement;
const [zoomIn, zoomOut, earlier, later, whole] = place.previousElementSibling.children;
const view = () => panels.map((panel) => panel.getAttribute("viewBox").split(" ").map(Number));
const press = (key) => place.dispatchEvent(new KeyboardEvent("keydown", { key, cancelable: true }));
const table = document.getElementById("case-table");
const order = () => [...table.tBodies[0].rows].map((row) => row.cells[0].textContent.trim());
const sorts = () => [...table.tHead.rows[0].cells].map((cell) => cell.getAttribute("aria-sort"));
const sort = (column) => {
  table.tHead.rows[0].cells[column].querySelector("button").click();
  return [order(), sorts()];
};
told.sorts = [[order(), sorts()], sort(3), sort(3), sort(0)];

told.whole = view();
zoomIn.click(); told.in = view();
later.click(); told.later = view();
press("ArrowLeft"); told.back = view();
press("0"); told.reset = view();
const box = panels[0].getBoundingClientRect();
SVGElement.prototype.setPointerCapture = () => {}; // no pointer is active in this test
const point = (type, share, options = {}) => plot.dispatchEvent(new PointerEvent(type, {
  button: 0, clientX: box.left + share * box.width, clientY: box.top + 5, ...options }));
point("pointerdown", 0.25); point("pointermove", 0.5);
told.selections = document.querySelectorAll(".selection").length;
point("pointerup", 0.5); told.dragged = view();
point("pointerdown", 0.5, { shiftKey: true }); point("pointermove", 0.4); point("pointerup", 0.4);
told.moved = view();
place.dispatchEvent(new WheelEvent("wheel", { deltaY: 100, ctrlKey: true,
  clientX: box.left + box.width / 2, cancelable: true }));
told.wheeled = view();
for (let k = 0; k < 20; k += 1) zoomIn.click();
told.closest = view();
whole.click();
told.pressed = [...place.parentElement.querySelectorAll(".legend button")].map((button) =>
  [button.textContent, button.getAttribute("aria-pressed")]);
const entry = place.parentElement.querySelector(".legend [data-style='0'] button");
entry.click();
told.hidden = [entry.getAttribute("aria-pressed"),
  [...plot.querySelectorAll("path[data-style='0']")].map((path) => path.style.display)];
told.visible = panels.map((panel) => panel.getBoundingClientRect().height);
told.curves = [...plot.querySelectorAll(".curve")].map((path) => path.getTotalLength());
then = () => {
  whole.click();
  for (let k = 0; k < 20; k += 1) zoomIn.click();
  told.drawn = panels[1].querySelector(".curve").getAttribute("d").match(/[ML]/g).length;
  whole.click();
  press(".");
  press(".");
  told.read = [...document.querySelector(".readout").children].map((line) => line.textContent);
  told.spoken = document.querySelector("output.unseen").value;
  press("Escape");
  told.hidden_again = document.querySelector(".readout").hidden;
  point("pointermove", 0.5);
  told.pointed = document.querySelector(".readout b").textContent;
  const titles = [...plot.querySelectorAll(".title")];
  const captions = titles.map((title) => title.textContent);
  const right = () => Math.max(...titles.map((title) => title.getBBox().x + title.getBBox().width));
  const wide = (width) => {
    document.body.style.width = width;
    dispatchEvent(new Event("resize"));
  };
  wide("376px");
  told.narrow = {
    room: place.clientWidth, scrolls: place.scrollWidth, drawn: plot.viewBox.baseVal.width,
    right: right(), panel: Number(panels[0].getAttribute("width")), captions,
    titles: titles.map((title) => title.textContent),
    note: place.nextElementSibling.textContent,
  };
  wide("");
  told.wide = [plot.viewBox.baseVal.width, titles.map((title) => title.textContent)];
};
