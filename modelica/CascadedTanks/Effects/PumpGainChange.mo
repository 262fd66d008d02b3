within CascadedTanks.Effects;
model PumpGainChange "a pump whose flow per voltage changes with the voltage"
  extends Common.Interfaces.Signal;
  parameter Real curvature(unit="1/V", min=-0.08, max=0.5) = 0.0 "Relative change of the gain, per voltage";
equation
  y = u*(1.0 + curvature*u);
  annotation (
    __Workbench(effect(
      size="curvature", matters=0.01,
      slots={"drive"},
      separation="steady flow of the pump into a bucket at several voltages")),
    Documentation(info="<html>
<p><code>y = u*(1 + curvature*u)</code>: the characteristic of pump and pipe.</p>
</html>"));
end PumpGainChange;
