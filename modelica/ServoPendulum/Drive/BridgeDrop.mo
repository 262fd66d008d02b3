within ServoPendulum.Drive;
model BridgeDrop "A bridge that loses a fixed voltage"
  extends Common.Signals.DeadZone(width=0.02, zone(unit="V", max=3.0));
  annotation (
    __Workbench(effect(
      size="zone", matters=0.05, slots={"bridge"},
      separation="the current with the shaft blocked, at small duties")),
    Documentation(info="<html>
<p>Brushes lose 0.1 to 1 V, a bridge of transistors up to 1.5 V; dead time between its switches acts
alike. Below it no current flows.</p>
</html>"));
end BridgeDrop;
