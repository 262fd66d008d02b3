within TrainRig.Effects;
model WeakPads "pads of an axle with less friction"
  extends Slots.PartialPads;
  parameter Real loss[n](each unit="1", each min=-0.6, each max=0.6) = zeros(n) "Share that is lost";
equation
  for i in 1:n loop
    y[i] = u[i]*(1.0 - loss[i]);
  end for;
  annotation (
    __Workbench(effect(
      size="loss", matters=0.04,
      separation="the pads of the axle, looked at")),
    Documentation(info="<html>
<p>Another material, oil, or wear that tilts the pads.</p>
</html>"));
end WeakPads;
