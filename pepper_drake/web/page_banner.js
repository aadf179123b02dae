// Says who leads, and whether the program still serves the page, which viser greys out if not.
const ENDED = "The program has ended, or cannot be reached. Started again, this page goes on.";
addEventListener("DOMContentLoaded", () => {
  const banner = document.createElement("div");
  banner.className = "banner";
  document.body.append(banner);
  let ended = false;
  // Viser connects again only once its window has the focus: a reload does not wait for that.
  const show = (text) => {
    if (ended && text === PEPPER_BANNER) location.reload();
    ended = text === ENDED;
    banner.textContent = text;
    banner.hidden = !text;
  };
  show(PEPPER_BANNER);
  setInterval(() => fetch(location.href, { method: "HEAD" }).then(
    ({ ok, status }) => show(ok ? PEPPER_BANNER : status === 403
      ? "The program was started again: open the address that it prints now." : ENDED),
    () => show(ENDED),
  ), 2000);
});
