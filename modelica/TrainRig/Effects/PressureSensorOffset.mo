within TrainRig.Effects;
model PressureSensorOffset "a pressure sensor of a bogie with an offset"
  extends Slots.PartialBogies;
  parameter Real offset[n](each unit="Pa", each min=-1e5, each max=1e5) = zeros(n) "Reading beyond the pressure";
equation
  for i in 1:n loop
    y[i] = u[i] - offset[i];
    rest[i] = restBefore[i] + offset[i];
    held[i] = heldBefore[i] + offset[i];
  end for;
  annotation (
    __Workbench(effect(
      size="offset", matters=900.0,
      separation="the reading while the train coasts")),
    Documentation(info="<html>
<p>It shows before the brake command, when cylinders are empty, and less in the force.</p>
</html>"));
end PressureSensorOffset;
