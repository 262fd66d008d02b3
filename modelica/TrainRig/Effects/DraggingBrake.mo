within TrainRig.Effects;
model DraggingBrake "a brake that drags on an axle"
  extends Slots.PartialDrag;
  parameter Real torque[n](each unit="N.m", each min=0.0, each max=5000.0) = zeros(n) "Of the pads that do not release";
equation
  for i in 1:n loop
    tau[i] = torque[i]*tanh(omega[i]/0.05);
  end for;
  annotation (
    __Workbench(effect(
      size="torque", matters=100.0,
      separation="the temperature of the axle's discs after a run without braking")),
    Documentation(info="<html>
<p>Pads that stay on their discs, also while nobody brakes.</p>
</html>"));
end DraggingBrake;
