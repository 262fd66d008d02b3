within ServoPendulum.Signals;
model ReadingDelay "A position that is reported late"
  extends Common.Signals.Delay(delay(min=-0.05, max=0.05));
  annotation (
    __Workbench(effect(
      size="delay", matters=1e-3, slots={"encoder"},
      separation="the reading beside that of a second encoder")),
    Documentation(info="<html>
<p>The controller has the position at once, the recording gets it by a bus, with the time at which it
was asked for or came. A negative delay is a time stamp that is late.</p>
</html>"));
end ReadingDelay;
