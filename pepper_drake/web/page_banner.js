// Says who leads, and that the program that serves the page has ended: viser greys the page out.
addEventListener("DOMContentLoaded", () => {
  const banner = document.createElement("div");
  banner.className = "banner";
  document.body.append(banner);
  const show = (text) => { banner.textContent = text; banner.hidden = !text; };
  show(PEPPER_BANNER);
  setInterval(() => fetch(location.href, { method: "HEAD" }).then(
    ({ status }) => show(status !== 403 ? PEPPER_BANNER
      : "The program was started again: open the address that it prints now."),
    () => show("The program has ended, or cannot be reached. Started again, this page goes on."),
  ), 2000);
});
