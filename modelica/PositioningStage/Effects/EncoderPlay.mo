within PositioningStage.Effects;
model EncoderPlay "play between screw and encoder"
  extends Common.Signals.Backlash(play(unit="m", max=1e-3));
  annotation (
    __Workbench(effect(
      size="play", matters=5e-6, slots={"encoder"},
      separation="the reading at a reversal, beside a second encoder at the carriage")),
    Documentation(info="<html>
<p>Of a coupling.</p>
</html>"));
end EncoderPlay;
