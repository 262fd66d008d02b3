within TrainRig.Effects;
model WrongMass "a vehicle that is not as heavy as it was weighed"
  extends Slots.PartialVehicles;
  parameter Real gain[n](each unit="1", each min=-0.5, each max=0.5) = zeros(n) "True over weighed, less one";
equation
  for i in 1:n loop
    y[i] = u[i]*(1.0 + gain[i]);
  end for;
  annotation (
    __Workbench(effect(
      size="gain", matters=0.06,
      separation="the vehicle on scales")),
    Documentation(info="<html>
<p>An air spring that leaks reads less than its load.</p>
</html>"));
end WrongMass;
