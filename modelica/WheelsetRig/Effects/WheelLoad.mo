within WheelsetRig.Effects;
model WheelLoad "A wheel load other than nominal"
  extends Quantities.PartialWheelLoad;
  extends Common.Signals.Gain(gain(min=-0.3, max=0.3));
  annotation (
    __Workbench(effect(
      size="gain", matters=0.02,
      separation="a step of the vertical load by 10 %")),
    Documentation(info="<html>
<p><code>y = u*(1 + gain)</code>. Changes adhesion in proportion and the stiffness of the
contact with the power 2/3.</p>
</html>"));
end WheelLoad;
