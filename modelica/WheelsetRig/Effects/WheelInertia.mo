within WheelsetRig.Effects;
model WheelInertia "An inertia of the wheelset other than nominal"
  extends Quantities.PartialWheelInertia;
  extends Common.Signals.Gain(gain(min=-0.5, max=0.5));
  annotation (
    __Workbench(effect(
      size="gain", matters=0.2,
      hidden="stops without slides show less of it than noise of the torque fakes",
      separation="a lifted spin-down")),
    Documentation(info="<html>
<p><code>y = u*(1 + gain)</code>. A stop moves by 0.3 % of the brake torque per 10 %; a
slide shows it.</p>
</html>"));
end WheelInertia;
