within ElectronicOscillator.Effects;
model SourceLag "a force that lags behind"
  extends Common.Signals.Lag(window=5e-4, lag(max=0.01));
  annotation (
    __Workbench(effect(
      size="lag", matters=2e-5, slots={"source"},
      separation="the phase at high frequencies")),
    Documentation(info="<html>
<p>Of an amplifier.</p>
</html>"));
end SourceLag;
