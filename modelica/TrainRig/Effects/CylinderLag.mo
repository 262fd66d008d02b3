within TrainRig.Effects;
model CylinderLag "cylinders of a bogie that lag behind their valve"
  extends Slots.PartialBogies;
  parameter Real lag[n](each unit="s", each min=0.0, each max=3.0) = zeros(n) "Time constant";
  Real past[n](each unit="Pa", each start=0.0, each fixed=true) "Pressure, smoothed";
protected
  final parameter Real window(unit="s") = 0.01 "Least time over which the rate is taken";
  Real tau[n](each unit="s") "Time constant of the smoothing";
equation
  for i in 1:n loop
    tau[i] = sqrt(lag[i]^2 + window^2);
    tau[i]*der(past[i]) = u[i] - past[i];
    y[i] = u[i] - lag[i]/tau[i]*(u[i] - past[i]);
  end for;
  rest = restBefore;
  held = heldBefore;
  annotation (
    __Workbench(effect(
      size="lag", matters=0.012,
      separation="a gauge at a cylinder of the bogie")),
    Documentation(info="<html>
<p>A narrowed pipe behind the valve: first order, exactly nothing at zero.</p>
</html>"));
end CylinderLag;
