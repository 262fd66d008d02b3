within HeatedHouse.Effects;
model InternalGain "a constant source of heat, or loss to the ground"
  extends Interfaces.PartialHeater;
  parameter Real gain(unit="W", min=-2000.0, max=2000.0) = 0.0 "Of all that is switched on";
equation
  heat = power + gain;
  annotation (
    __Workbench(effect(
      size="gain", matters=20.0,
      separation="a power meter at the mains")),
    Documentation(info="<html>
<p>Computers that run day and night; negative, what leaves to a ground of constant temperature.</p>
</html>"));
end InternalGain;
