/** Short messages in the corner of the page; their code loads after the page itself. */

import type { NotificationData } from "@mantine/notifications";

export const loadNotifications = () => import("@mantine/notifications");

export function notify(message: NotificationData): void {
  void loadNotifications().then(({ notifications }) => notifications.show({ closeButtonProps: { "aria-label": "Dismiss" }, ...message }));
}
