within ElectronicOscillator.Effects;
model SourceBend "a force that bends with the input"
  extends Common.Interfaces.Signal;
  parameter Real bend(unit="1/V2", min=-30.0, max=30.0) = 0.0 "Relative change per square of it";
equation
  y = u*(1.0 + bend*u^2);
  annotation (
    __Workbench(effect(
      size="bend", matters=0.5, slots={"source"},
      separation="static force over input")),
    Documentation(info="<html>
<p><code>y = u*(1 + bend*u^2)</code>: an amplifier close to its limit.</p>
</html>"));
end SourceBend;
