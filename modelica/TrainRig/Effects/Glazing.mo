within TrainRig.Effects;
model Glazing "pads that glaze on hot discs"
  extends Slots.PartialPads;
  parameter Real loss(unit="1", min=-0.6, max=0.6) = 0.0 "Share that is lost far above the temperature";
  parameter Real hot(unit="K", min=320.0, max=600.0) = 383.15 "Temperature at which half of it is lost";
  final parameter Real width(unit="K") = 6.0 "Over which it sets in";
equation
  for i in 1:n loop
    y[i] = u[i]*(1.0 - loss/(1.0 + exp(-(T[i] - hot)/width)));
  end for;
  annotation (
    __Workbench(effect(
      size="loss", matters=0.005,
      separation="two stops in a row, the second with warm discs")),
    Documentation(info="<html>
<p>The binder of the pads melts and covers them: friction falls over a few degrees.</p>
</html>"));
end Glazing;
