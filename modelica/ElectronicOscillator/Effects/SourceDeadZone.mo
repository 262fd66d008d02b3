within ElectronicOscillator.Effects;
model SourceDeadZone "an input that does nothing where it is small"
  extends Common.Signals.DeadZone(zone(unit="V", max=0.05));
  annotation (
    __Workbench(effect(
      size="zone", matters=2e-4, slots={"source"},
      separation="static force over input")),
    Documentation(info="<html>
<p>Of an amplifier that crosses over.</p>
</html>"));
end SourceDeadZone;
