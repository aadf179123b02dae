// Sends keys and the gamepad's state to the session, which viser's own page does not.
(() => {
  const url = new URL("/input", location.href.replace(/^http/, "ws"));
  let socket, before = "{}";
  const connect = () => {
    socket = new WebSocket(url);
    socket.onclose = () => setTimeout(connect, 2000);
  };
  const tell = (message) => {
    if (socket && socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify(message));
  };
  connect();
  // Runs before viser's own listeners, which would move the camera.
  for (const kind of ["keydown", "keyup"]) {
    window.addEventListener(kind, (event) => {
      const tag = event.target && event.target.tagName;
      if (tag === "INPUT" || tag === "TEXTAREA" || tag === "BUTTON") return;
      if (event.ctrlKey || event.metaKey || event.altKey) return;
      if (!PEPPER_KEYS.includes(event.code)) return;
      event.preventDefault();
      event.stopImmediatePropagation();
      if (kind === "keydown") tell({ key: event.code });
    }, true);
  }
  setInterval(() => {
    const pad = [...navigator.getGamepads()].find((one) => one !== null);
    const state = !pad ? {} : {
      index: pad.index,
      axes: [...pad.axes],
      button_values: pad.buttons.map((button) => button.value),
    };
    const text = JSON.stringify(state);
    if (text === before) return;
    before = text;
    tell({ gamepad: state });
  }, 50);
})();
