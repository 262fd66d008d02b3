within TrainRig.Effects;
model LateSpeed "a speed sensor that reads late"
  extends Slots.PartialAxles;
  parameter Real lag[n](each unit="s", each min=0.0, each max=1.0) = zeros(n) "Time by which it is late";
  Real past[n](each unit="rad/s", each start=0.0, each fixed=true) "Speed, smoothed";
protected
  final parameter Real window(unit="s") = 0.01 "Least time over which the rate is taken";
  Real tau[n](each unit="s") "Time constant of the smoothing";
equation
  for i in 1:n loop
    tau[i] = sqrt(lag[i]^2 + window^2);
    tau[i]*der(past[i]) = u[i] - past[i];
    y[i] = u[i] - lag[i]/tau[i]*(u[i] - past[i]);
  end for;
  annotation (
    __Workbench(effect(
      size="lag", matters=3e-4, slots={"speedSensor"},
      separation="the reading beside another axle's while the train brakes hard")),
    Documentation(info="<html>
<p>A filter with another time: first order, exactly nothing at zero.</p>
</html>"));
end LateSpeed;
