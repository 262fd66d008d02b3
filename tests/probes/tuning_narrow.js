const dots = document.querySelector(".dots");
then = () => {
  document.body.style.width = "376px";
  dispatchEvent(new Event("resize"));
  told.room = dots.parentElement.clientWidth;
  told.drawn = dots.viewBox.baseVal.width;
  told.dots = [...dots.querySelectorAll("circle")].map((part) => part.cx.baseVal.value);
  told.names = [...dots.querySelectorAll("text[text-anchor=start]")].map((part) => part.getBBox().x)
    .map(Math.round);
};
