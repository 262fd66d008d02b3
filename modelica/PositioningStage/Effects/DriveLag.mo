within PositioningStage.Effects;
model DriveLag "a drive whose force lags behind the command"
  extends Common.Signals.Lag(window=1e-3, lag(max=0.02));
  annotation (
    __Workbench(effect(
      size="lag", matters=2e-4, slots={"drive"},
      separation="steps of the command at a blocked carriage")),
    Documentation(info="<html>
<p>The current follows the command by the time constant of the winding, or of its control.</p>
</html>"));
end DriveLag;
