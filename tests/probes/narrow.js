then = () => {
  for (const part of document.querySelectorAll("details")) part.open = true;
  document.body.style.width = "296px";
  dispatchEvent(new Event("resize"));
  const sideways = (part) => part.scrollWidth > part.clientWidth;
  const places = [...document.querySelectorAll(".scroll")];
  told.sideways = places.filter(sideways).map((part) => part.getAttribute("aria-label"));
  const drawn = [...document.querySelectorAll("main svg:not(svg svg)")];
  told.drawn = drawn.map((part) => [part.viewBox.baseVal.width, part.getBoundingClientRect().width]);
  told.cut = [...document.querySelectorAll("main svg text")].filter((part) => {
    const [text, page] = [part.getBoundingClientRect(), part.closest("main").getBoundingClientRect()];
    return text.left < page.left - 1 || text.right > page.right + 1;
  }).map((part) => part.textContent);
};
