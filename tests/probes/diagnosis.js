const plots = [...document.querySelectorAll(".plot")];
told.panels = plots.map((plot) =>
  [...plot.querySelectorAll(".panel")].map((panel) => panel.getBoundingClientRect().height));
told.curves = [...document.querySelectorAll(".curve")].map((path) => path.getTotalLength());
told.sizes = [".matrix", ".dots"].map((name) =>
  document.querySelector(name).getBoundingClientRect().height);
const table = document.getElementById("candidate-table");
const order = () => [...table.tBodies[0].rows].map((row) => row.cells[0].textContent.trim());
const press = (column) => {
  table.tHead.rows[0].cells[column].querySelector("button").click();
  return order();
};
told.orders = [order(), press(0), press(5), press(5)];
const tools = document.querySelectorAll(".tools");
told.tools = tools.length;
const view = () => plots[0].querySelector(".panel").getAttribute("viewBox").split(" ").map(Number);
told.whole = view();
tools[0].children[0].click();
told.zoomed = view();
const cells = [...document.querySelectorAll("#dependence-table .heat")];
told.heat = cells.map((cell) => getComputedStyle(cell).backgroundColor);
told.shares = cells.map((cell) => Number(cell.dataset.value));
told.overflow = document.documentElement.scrollWidth - document.documentElement.clientWidth;
