then = () => {
  const place = document.querySelector(".reading");
  place.dispatchEvent(new KeyboardEvent("keydown", { key: ".", bubbles: true }));
  told.read = document.querySelector(".readout b").textContent;
};
