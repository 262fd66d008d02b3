within TrainRig.Effects;
model IsolatedUnit "brake units of an axle that are cut off"
  extends Slots.PartialAxles;
  parameter Real lost[n](each unit="1", each min=0.0, each max=3.0) = zeros(n) "Units without pads on their disc";
equation
  for i in 1:n loop
    y[i] = u[i] - lost[i];
  end for;
  annotation (
    __Workbench(effect(
      size="lost", matters=0.1, slots={"brakeUnits"}, after="WeakPads",
      separation="a look at the cocks of the axle's brake units")),
    Documentation(info="<html>
<p>Units are cut off whole: a size far from 1 is another cause. The other discs of the axle stay as warm as
they were.</p>
</html>"));
end IsolatedUnit;
