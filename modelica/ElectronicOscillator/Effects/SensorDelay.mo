within ElectronicOscillator.Effects;
model SensorDelay "a reading that is late"
  extends Common.Signals.Delay(window=5e-4, delay(min=-5e-3, max=5e-3));
  annotation (
    __Workbench(effect(
      size="delay", matters=2e-5, slots={"sensor"},
      separation="the phase at high frequencies")),
    Documentation(info="<html>
<p>Of filters before the card.</p>
</html>"));
end SensorDelay;
