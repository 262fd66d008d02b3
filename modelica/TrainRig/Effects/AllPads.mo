within TrainRig.Effects;
model AllPads "pads of all axles with less friction"
  extends Slots.PartialPads;
  parameter Real loss(unit="1", min=-0.6, max=0.6) = 0.0 "Share that is lost";
equation
  y = u*(1.0 - loss);
  annotation (
    __Workbench(effect(
      size="loss", matters=0.03,
      separation="the material of the pads, read off them")),
    Documentation(info="<html>
<p>Another material on the whole train.</p>
</html>"));
end AllPads;
